"""What is found in a file before anything starts."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Request

ROBOT = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/command" }
    }
    action_type: ACTION_SINGLE
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
  perceptions {
    node {
      node_name: "keyboard" node_id: 2
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" }
    }
    perception_type: PERCEPTION_KEYBOARD
    keyboard_config { controls { positive: "d" negative: "a" joint: "JOINT" speed_rad_s: 1 } }
  }
  OTHER
}
"""
SECOND = """
  perceptions {
    node {
      node_name: "second" node_id: 3
      publishers { data_type: JOY topic_name: "/joy" publish_rate_hz: 20 }
    }
    perception_type: PERCEPTION_KEYBOARD
    keyboard_config { controls { positive: "x" joint: "joint_1" speed_rad_s: 1 } }
  }
"""


def write(folder: Path, joint: str = "joint_1", other: str = "") -> str:
    path = folder / "robot.pbtxt"
    path.write_text(ROBOT.replace('JOINT"', f'{joint}"').replace("OTHER", other))
    return str(path)


def test_a_joint_that_the_actuator_lacks_is_found_with_the_nearest(tmp_path: Path) -> None:
    (found,) = (
        item
        for item in examine(Request(write(tmp_path, "joint_3"))).diagnostics
        if item.code == "invalid-setting"
    )
    assert found.field_path == "robot.perceptions[0].keyboard_config.controls[0].joint"
    assert found.position is not None
    assert found.message == "The actuator has no joint named 'joint_3'."
    assert set(found.allowed) == {"joint_1", "joint_2"}


def test_every_wrong_name_is_found_in_one_run(tmp_path: Path) -> None:
    path = Path(write(tmp_path, "joint_3"))
    path.write_text(path.read_text().replace('positive: "d"', 'positive: "dd"'))
    found = [item for item in examine(Request(str(path))).diagnostics if item.code == "invalid-setting"]
    assert [item.field_path.rpartition(".")[2] for item in found] == ["positive", "joint"]
    assert all(item.position is not None and item.remedy for item in found)


def test_names_of_an_arm_without_calibration_are_not_judged(tmp_path: Path) -> None:
    text = Path(write(tmp_path, "shoulder_pan")).read_text()
    real = """sts3215_config { comm { serial { port: "/dev/ttyACM0" baudrate: 1000000 } } motor_ids: [1]
      position_max: 4095 }"""
    text = text.replace("mock_motor_config { num_motors: 2 position_max: 4095 }", real)
    path = tmp_path / "robot.pbtxt"
    path.write_text(text)
    examination = examine(Request(str(path)))
    assert [item for item in examination.diagnostics if item.code == "invalid-setting"] == []
    assert examination.plan is not None  # nor by the node, before the arm says that it is not calibrated
    assert next(node for node in examination.plan.nodes if node.name == "keyboard").facts.joints == ()
    waived = examine(Request(str(path), allow_uncalibrated=True)).diagnostics
    assert [item.message for item in waived if item.code == "invalid-setting"] == [
        "The actuator has no joint named 'shoulder_pan'."
    ]


def test_two_keyboards_cannot_share_the_terminal(tmp_path: Path) -> None:
    found = [
        item
        for item in examine(Request(write(tmp_path, other=SECOND))).diagnostics
        if item.code == "terminal-shared"
    ]
    assert len(found) == 1
    assert "keyboard and second both read the terminal" in found[0].message
    assert examine(Request(write(tmp_path))).plan is not None


def test_the_plan_says_who_reads_the_terminal_and_what_it_reaches(tmp_path: Path) -> None:
    plan = examine(Request(write(tmp_path))).plan
    assert plan is not None
    keyboard = next(node for node in plan.nodes if node.name == "keyboard")
    assert keyboard.facts.terminal is True
    assert [joint.name for joint in keyboard.facts.joints] == ["joint_1", "joint_2"]
    assert keyboard.settings["joints"] == ["joint_1", "joint_2"]


JOY = """
general { mode: MODE_TEST id: "bench" }
robot {
  perceptions {
    node {
      node_name: "gamepad" node_id: 1
      publishers { data_type: JOY topic_name: "/joy" publish_rate_hz: 20 }
    }
    perception_type: PERCEPTION_GAMEPAD
    gamepad_config { CONTROLS }
  }
}
"""
STICK = 'controls { positive: "left_x" joint: "pan" speed_rad_s: 1 }'


@pytest.mark.parametrize(("controls", "found"), [("", []), (STICK, ["field-unused"])])
def test_a_joy_alone_needs_no_controls(tmp_path: Path, controls: str, found: list[str]) -> None:
    (tmp_path / "robot.pbtxt").write_text(JOY.replace("CONTROLS", controls))
    examination = examine(Request(str(tmp_path / "robot.pbtxt")))
    codes = [
        item.code
        for item in examination.diagnostics
        if "controls" in item.field_path or "joint" in item.message
    ]
    assert codes == found
