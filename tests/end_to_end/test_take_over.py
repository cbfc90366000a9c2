"""One commander at a time: an override takes control of an arm from its leader, a stranger does not."""

from __future__ import annotations

import math
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from joshua.messages import decode, encode
from joshua.messages.make import joint_state
from joshua.plan import QosProfile
from joshua.testing.program import JoshuaProgram
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport

JOINT_STATE = "sensor_msgs/msg/JointState"
ROBOT = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "leader" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
  actions {
    node {
      node_name: "guide" node_id: 2 host: "desk"
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 override: true }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 1 position_min: 2048 position_max: 3072 }
  }
  actions {
    node {
      node_name: "follower" node_id: 3
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/command" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
}
"""


class Desk:
    """The other machine: the override, a stranger, and a subscription to what the follower writes."""

    def __init__(self, transport: Any) -> None:
        self._transport = transport
        self.written: list[float] = []
        self.sent_s: list[float] = []
        node = transport.create_node("guide")
        self._publisher = node.create_publisher("/command", JOINT_STATE, QosProfile())
        talker = transport.create_node("talker")
        self._stranger = talker.create_publisher("/command", JOINT_STATE, QosProfile())
        node.create_subscription("/follower/applied_command", JOINT_STATE, QosProfile(), self._hear)

    def _hear(self, sample: Any) -> None:
        self.written.append(float(decode(JOINT_STATE, sample.cdr).position[0]))

    def wait(self, reached: Any, *, send_rad: float | None = None) -> None:
        """Waits until the newest written position fits; sends a position at 50 Hz meanwhile."""
        end_s = time.monotonic() + 60
        while not (self.written and reached(self.written[-1])):
            assert time.monotonic() < end_s, f"the follower wrote {self.written[-5:]}"
            if send_rad is not None:
                self._publisher.publish(encode(joint_state(["joint_1"], [send_rad])))
                self.sent_s.append(time.monotonic())
            time.sleep(0.02)

    def interfere(self) -> None:
        """Commands the follower for two seconds, without being named by its file."""
        for _ in range(100):
            self._stranger.publish(encode(joint_state(["joint_1"], [1.0])))
            time.sleep(0.02)

    def close(self) -> None:
        self._transport.close()


@pytest.mark.timing
@pytest.mark.parametrize("kind", ["zenoh", "dds"])
def test_an_override_has_control_until_it_is_released_and_a_stranger_never(
    kind: Any, joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    spec = transport_settings(kind, domain_id=joshua_domain_id, listen_endpoints=(joshua_run.router,))
    (tmp_path / "robot.pbtxt").write_text(ROBOT)
    if kind == "dds":
        joshua_run.router = ""
        (tmp_path / "robot.pbtxt").write_text(f"{ROBOT} transport {{ kind: TRANSPORT_DDS }}")
    run = joshua_run.start("--config", "robot.pbtxt")
    desk = None
    try:
        while desk is None:  # the run hosts the router
            assert run.poll() is None
            transport = open_transport(spec)
            if transport.connected:
                desk = Desk(transport)
            else:
                transport.close()
                time.sleep(0.1)
        desk.wait(lambda position: abs(position) < 1e-6)
        first = len(desk.written)
        desk.interfere()
        assert len(desk.written) > first
        assert max(map(abs, desk.written[first:])) < 1e-6
        first = len(desk.written)
        desk.wait(lambda position: len(desk.written) > first + 25, send_rad=0.2)
        assert max(map(abs, desk.written[first:])) < 1e-6, "the guide lies still"
        # three quarters of the way through the guide's own range, so through the follower's
        desk.wait(lambda position: abs(position - math.pi / 2) < 5e-3, send_rad=0.75 * math.pi / 2)
        first = len(desk.written)
        desk.wait(lambda position: len(desk.written) > first + 25, send_rad=0.75 * math.pi / 2)
        assert max(abs(position - math.pi / 2) for position in desk.written[first:]) < 5e-3
        stopped = len(desk.written)
        time.sleep(1.0)  # the leader publishes all the time
        desk.wait(lambda position: len(desk.written) > stopped + 25)
        assert max(abs(position - math.pi / 2) for position in desk.written[stopped:]) < 5e-3
        status = joshua_run("status").stdout
        called = joshua_run("call", "follower", "release_override")
        assert called.returncode == 0, called.stderr
        desk.wait(lambda position: abs(position) < 1e-6)
    finally:
        if desk is not None:
            desk.close()
        output, errors = joshua_run.stop(run)
    said = output + errors
    assert run.returncode == 0, said
    pauses = sum(later_s - sent_s > 0.15 for sent_s, later_s in pairwise(desk.sent_s))  # of a busy machine
    assert said.count("/command: commands from /talker are refused: the configuration does not name it") == 1
    assert "override /guide stopped publishing: holding; " in status
    assert "commands refused from /talker" in status
    takes = said.count("/guide overrides: commands of other nodes are ignored")
    assert 1 <= takes <= 1 + pauses
    assert said.count("the override /guide stopped publishing: the joints hold their position") == takes
    assert said.count("the override /guide is released: other commanders have control again") == 1
