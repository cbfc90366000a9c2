"""A follower without a leader, driven by nodes outside its file: radians, limits, ramp and watchdog hold."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eventually import eventually
from joshua.messages import decode, encode, message_class
from joshua.messages.make import header, joint_state
from joshua.plan import QosProfile
from joshua.testing.program import JoshuaProgram
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport

JOINT_STATE = "sensor_msgs/msg/JointState"
LOG = "rcl_interfaces/msg/Log"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
ROBOT = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "follower" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/follower/joint_commands" external: true }
      subscriptions { data_type: JOINT_TRAJECTORY topic_name: "/follower/trajectory" external: true }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 2 position_min: 1024 position_max: 3072 }
  }
}
"""


class Outside:
    """Nodes of other programs, and what the follower says that it wrote."""

    def __init__(self, transport: Any) -> None:
        self._transport = transport
        self.written: list[tuple[float, float]] = []
        moveit, talker = transport.create_node("moveit"), transport.create_node("talker")
        self._commands = moveit.create_publisher("/follower/joint_commands", JOINT_STATE, QosProfile())
        self._trajectory = moveit.create_publisher("/follower/trajectory", JOINT_TRAJECTORY, QosProfile())
        self._others = talker.create_publisher("/follower/joint_commands", JOINT_STATE, QosProfile())
        moveit.create_subscription("/follower/applied_command", JOINT_STATE, QosProfile(), self._hear)
        self.logged: list[str] = []
        moveit.create_subscription("/rosout", LOG, QosProfile(), self._take_log)

    def _hear(self, sample: Any) -> None:
        message = decode(JOINT_STATE, sample.cdr)
        stamp = message.header.stamp
        self.written.append((stamp.sec + stamp.nanosec / 1e9, float(message.position[0])))

    def _take_log(self, sample: Any) -> None:
        self.logged.append(decode(LOG, sample.cdr).msg)

    def command(self, rad: float, *, other: bool = False) -> None:
        publisher = self._others if other else self._commands
        publisher.publish(encode(joint_state(["joint_1"], [rad])))

    def play(self, rad: float, seconds: int) -> None:
        duration = message_class("builtin_interfaces/msg/Duration")(seconds, 0)
        none = np.zeros(0)
        point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")(
            np.array([rad]), none, none, none, duration
        )
        self._trajectory.publish(encode(message_class(JOINT_TRAJECTORY)(header(""), ["joint_1"], [point])))

    def wait(self, reached: Callable[[float], bool], act: Callable[[], None] = lambda: None) -> None:
        deadline_s = time.monotonic() + 60
        while not (self.written and reached(self.written[-1][1])):
            assert time.monotonic() < deadline_s, self.written[-5:]
            act()
            time.sleep(0.02)

    def wait_for_log(self, fits: Callable[[str], bool], act: Callable[[], None]) -> None:
        deadline_s = time.monotonic() + 60
        while not any(map(fits, list(self.logged))):
            assert time.monotonic() < deadline_s, self.logged[-5:]
            act()
            time.sleep(0.02)

    def close(self) -> None:
        self._transport.close()


@pytest.mark.timing
@pytest.mark.parametrize("kind", ["zenoh", "dds"])
def test_nodes_outside_the_file_drive_a_follower_one_at_a_time(
    kind: Any, joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    settings = transport_settings(kind, domain_id=joshua_domain_id, listen_endpoints=(joshua_run.router,))
    (tmp_path / "robot.pbtxt").write_text(ROBOT)
    if kind == "dds":
        joshua_run.router = ""
        (tmp_path / "robot.pbtxt").write_text(f"{ROBOT} transport {{ kind: TRANSPORT_DDS }}")
    run = joshua_run.start("--config", "robot.pbtxt")
    outside = None
    try:
        while outside is None:  # the run hosts the router
            assert run.poll() is None
            transport = open_transport(settings)
            if transport.connected:
                outside = Outside(transport)
            else:
                transport.close()
                time.sleep(0.1)
        node = outside
        node.wait(lambda rad: abs(rad) < 1e-3)
        node.wait(lambda rad: rad > 0.399, lambda: node.command(0.4))  # radians, and no leader's share
        began = len(node.written)
        for _ in range(50):
            node.command(0.4)
            node.command(-1.0, other=True)
            time.sleep(0.02)
        assert min(rad for _, rad in node.written[began:]) > 0.399, "one commander at a time"
        node.wait(lambda rad: rad > 1.5, lambda: node.command(9.0))
        time.sleep(1.0)
        assert node.written[-1][1] == pytest.approx(np.pi / 2, abs=2e-3), (
            "the limit of the file; then it holds"
        )
        began = len(node.written)
        node.play(0.5, 2)
        node.wait(lambda rad: rad < 0.501)
        moving_s = [stamp_s for stamp_s, rad in node.written[began:] if 0.51 < rad < np.pi / 2 - 0.02]
        assert moving_s[-1] - moving_s[0] > 1.6, "in two seconds, and not as fast as the joint can"
        time.sleep(1.0)
        assert node.written[-1][1] == pytest.approx(0.5, abs=2e-3), "a trajectory that ended is not stale"
        assert joshua_run("estop").returncode == 0
        assert joshua_run("estop", "--release").returncode == 0
        remedy = "Run `joshua resume follower` to re-enable torque"
        said = (
            f"commands from /moveit have no effect: the e-stop is released, but torque is still off. {remedy}"
        )
        node.wait_for_log(lambda text: text.endswith(said), lambda: node.command(0.4))

        def status() -> str:  # each node sends it within a second
            node.command(0.4)
            return " ".join(joshua_run("status").stdout.split())

        eventually(lambda: "commands without effect from /moveit" in status(), "the status")
        assert remedy in status()
        assert joshua_run("resume", "follower").returncode == 0
        node.wait(lambda rad: abs(rad - 0.4) < 1e-3, lambda: node.command(0.4))
    finally:
        if outside is not None:
            outside.close()
        output, errors = joshua_run.stop(run)
    said = output + errors
    assert run.returncode == 0, said
    assert said.count("commands from /talker are refused: /moveit is the commander") == 1
    assert "commands stopped: the joints hold their position" in said
    assert said.count("/moveit commands joint_1 to 9 rad, its limits are -1.571 to 1.571 rad") == 1
    assert said.count("commands from /moveit have no effect: the e-stop is released") == 1
