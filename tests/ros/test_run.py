"""A whole run beside ROS 2's own rclpy: it sees the robot, and drives an arm as a planner does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from joshua.testing.program import JoshuaProgram

ROBOT = """
general { mode: MODE_TELEOPERATE name: "bench" id: "bench-003" }
transport { kind: TRANSPORT_DDS }
robot {
  actions {
    node { node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_TRAJECTORY topic_name: "/arm/trajectory" external: true } }
    action_type: ACTION_FOLLOWER mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
"""
STATES = "/arm/joint_states"


def test_a_planner_of_ros_2_moves_an_arm(
    share: Path, start_peer: Any, domain_id: int, eventually: Any, tmp_path: Path
) -> None:
    (tmp_path / "robot.pbtxt").write_text(ROBOT)
    joshua = JoshuaProgram(tmp_path, domain_id)
    joshua.router = ""  # DDS has none
    try:
        run = joshua.start("--config", "robot.pbtxt")
        peer = start_peer()
        peer.watch_joints(STATES)
        eventually(lambda: peer.texts(STATES), what="a joint state")
        eventually(lambda: "/arm" in peer.graph()["nodes"], what="the name of the node")  # may come later
        graph = peer.graph()
        assert graph["topics"]["/arm/applied_command"] == ["sensor_msgs/msg/JointState"]
        assert {"/rosout", "/parameter_events"} <= set(graph["topics"])
        assert peer.parameters("/arm") is None

        peer.play("/arm/trajectory", ["joint_1", "joint_2"], [[0.4, [0.1, 0.0]], [0.8, [0.2, -0.1]]])
        arrived = {"joint_1": pytest.approx(0.2, abs=0.01), "joint_2": pytest.approx(-0.1, abs=0.01)}
        eventually(lambda: peer.texts(STATES) == arrived, what="the end of the trajectory")

        output, errors = joshua.stop(run)
        assert run.returncode == 0, output + errors
    finally:
        joshua.close()
