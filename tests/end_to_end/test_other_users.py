"""Another user of this machine against a whole robot: calls every service, publishes on every topic."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.messages import encode, make
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from leader_and_copy import LEADER_AND_COPY
from second_user import SecondUser, needs_second_user

ATTACK = Path(__file__).parents[1] / "core/transport/programs/other_user.py"
#: An arm beside those two, which every node of this user may command.
FREE = """
robot {
  actions {
    node { node_name: "free" node_id: 3
      subscriptions { data_type: JOINT_STATE topic_name: "/free/joint_commands" external: true }
      subscriptions { data_type: JOINT_TRAJECTORY topic_name: "/free/trajectory" external: true } }
    action_type: ACTION_FOLLOWER mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
"""

pytestmark = needs_second_user


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    robot = f'include: "free.pbtxt"\n{LEADER_AND_COPY}'
    (tmp_path / "robot.pbtxt").write_text(robot, encoding="utf-8")
    (tmp_path / "free.pbtxt").write_text(FREE, encoding="utf-8")
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id, {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"})
        yield program
        program.close()


def attack(joshua: JoshuaProgram, user: int) -> dict[str, int]:
    """What a program of a user reached: the topics and services that it tried, and the answers it got."""
    port = joshua.router.rsplit(":", 1)[1]
    message = bytes(encode(make.joint_state(["joint_1"], [0.3]))).hex()
    command = [sys.executable, str(ATTACK), str(user), port, message]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found: dict[str, int] = json.loads(done.stdout)
    return found


def test_another_user_commands_nothing_and_calls_no_service(
    joshua: JoshuaProgram, second_user: SecondUser
) -> None:
    run = joshua.start("--config", "robot.pbtxt")
    assert run.stdout is not None
    table = []
    for line in run.stdout:
        table.append(line)
        if "commands:" in line:
            break
    text = "".join(table)
    assert "commands: from this user and root; other users of this machine can only watch" in text

    stranger = attack(joshua, second_user.uid)
    assert stranger["topics"] > 4
    assert stranger["calls"] > 20, "parameters, lifecycle states and verbs of three arms"
    assert stranger["answers"] == 0

    own = attack(joshua, 0)
    assert own["answers"] == own["calls"] == stranger["calls"], "the attack itself is sound"
    output, errors = joshua.stop(run)
    assert run.returncode == 0, output + errors
    (received,) = (line.split() for line in output.splitlines() if "in /free/joint_commands" in line)
    assert received[-1] == "1", "the message of this user, and none of the other one"
