"""A follower writes its leader's position when it arrives, and not at the next tick of a clock of its own."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from joshua.messages import decode
from joshua.plan import QosProfile
from joshua.testing.program import JoshuaProgram
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport

JOINT_STATE = "sensor_msgs/msg/JointState"
RATE_HZ = 10.0
ROBOT = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "leader" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 10 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 1 position_max: 4095 motion: MOCK_MOTION_SINE motion_frequency_hz: 0.2 }
  }
  actions {
    node {
      node_name: "follower" node_id: 2
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 10 }
      subscriptions { data_type: JOINT_STATE topic_name: "/leader/joint_states" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
}
"""


@pytest.mark.timing
def test_a_goal_follows_its_command_within_a_fraction_of_the_period(
    joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    spec = transport_settings("zenoh", domain_id=joshua_domain_id, listen_endpoints=(joshua_run.router,))
    (tmp_path / "robot.pbtxt").write_text(ROBOT)
    run = joshua_run.start("--config", "robot.pbtxt")
    stamps_s: dict[str, list[float]] = {"leader": [], "follower": []}

    def hear(name: str, sample: Any) -> None:
        stamp = decode(JOINT_STATE, sample.cdr).header.stamp
        stamps_s[name].append(stamp.sec + stamp.nanosec / 1e9)

    transport = None
    try:
        deadline_s = time.monotonic() + 60
        while transport is None:  # the run hosts the router
            assert run.poll() is None
            assert time.monotonic() < deadline_s
            opened = open_transport(spec)
            if opened.connected:
                transport = opened
            else:
                opened.close()
                time.sleep(0.1)
        node = transport.create_node("ear")
        for name, topic in (("leader", "/leader/joint_states"), ("follower", "/follower/applied_command")):
            node.create_subscription(topic, JOINT_STATE, QosProfile(), partial(hear, name))
        while min(map(len, stamps_s.values())) < 80:
            assert time.monotonic() < deadline_s
            time.sleep(0.1)
    finally:
        if transport is not None:
            transport.close()
        output, errors = joshua_run.stop(run)
    assert run.returncode == 0, output + errors
    ages_s = [
        written_s - max(read_s for read_s in stamps_s["leader"] if read_s <= written_s)
        for written_s in stamps_s["follower"][40:]
    ]
    assert median(ages_s) < 0.15 / RATE_HZ, "by a clock of its own it is anywhere within a period"
