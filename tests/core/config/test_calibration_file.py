"""The robot's calibration file is loaded by itself where no other file holds one."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.config import check, load
from joshua.config.loading import calibration_path, journal_path
from joshua.plan import Severity

ROBOT = """
general {{ mode: {mode} id: "{robot_id}" name: "rig" }}
robot {{ actions {{
  node {{ node_name: "leader_arm" node_id: 1 node_type: PYTHON
    publishers {{ data_type: JOINT_STATE topic_name: "/leader" publish_rate_hz: 50 }} }}
  action_type: ACTION_LEADER
  sts3215_config {{ comm {{ serial {{ port: "/dev/ttyACM0" baudrate: 1000000 }} }} motor_ids: 1 }}
}} }}
"""
ARM = 'arms {{ node_name: "{0}" motors {{ id: 1 joint_name: "pan" range_max: 4095 }} }}'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "calibration").mkdir()
    arms = ARM.format("leader_arm") + ARM.format("follower_arm")
    (tmp_path / "calibration" / "arm-7.pbtxt").write_text(f"calibration {{ {arms} }}")
    return tmp_path


def robot(folder: Path, mode: str = "MODE_TELEOPERATE", robot_id: str = "arm-7", more: str = "") -> Path:
    path = folder / "robot.pbtxt"
    path.write_text(more + ROBOT.format(mode=mode, robot_id=robot_id))
    return path


def test_it_is_loaded_with_its_positions(folder: Path):
    loaded = load(robot(folder))
    assert [arm.node_name for arm in loaded.config.calibration.arms] == ["leader_arm", "follower_arm"]
    assert loaded.calibration_file == str(folder / "calibration" / "arm-7.pbtxt")
    position = loaded.positions.value("calibration.arms[0].node_name")
    assert position is not None
    assert position.file == loaded.calibration_file


def test_an_arm_that_this_configuration_does_not_have_is_a_note(folder: Path):
    (found,) = (item for item in check(load(robot(folder))) if item.code.startswith("calibration"))
    assert (found.code, found.severity) == ("calibration-unknown-node", Severity.NOTE)


def test_the_id_of_the_command_line_decides(folder: Path):
    assert not load(robot(folder), overrides=["general.id=other"]).calibration_file
    assert load(robot(folder, robot_id="other"), overrides=["general.id=arm-7"]).calibration_file


def test_a_file_with_a_calibration_of_its_own_keeps_it(folder: Path):
    loaded = load(robot(folder, more=f"calibration {{ {ARM.format('leader_arm')} }}"))
    assert len(loaded.config.calibration.arms) == 1
    assert not loaded.calibration_file


def test_one_that_is_included_is_not_loaded_twice(folder: Path):
    loaded = load(robot(folder, more='include: "calibration/arm-7.pbtxt"'))
    assert loaded.diagnostics == []
    assert len(loaded.config.calibration.arms) == 2


def test_what_is_wrong_in_it_is_found_there(folder: Path):
    path = folder / "calibration" / "arm-7.pbtxt"
    path.write_text("calibration { armz { } }")
    (problem,) = load(robot(folder)).diagnostics
    assert problem.position is not None
    assert problem.position.file == str(path)


@pytest.mark.parametrize("robot_id", ["", "../arm-7", "a/b", "..", "a" * 101, "x\n"])
def test_an_id_that_is_no_file_name_leads_nowhere(robot_id: str):
    assert calibration_path("robots/robot.pbtxt", robot_id) == ""


def test_the_note_of_an_interrupted_calibration_stands_beside_it():
    path = calibration_path("robots/robot.pbtxt", "arm-7")
    assert path == "robots/calibration/arm-7.pbtxt"
    assert journal_path(path, "leader_arm") == "robots/calibration/arm-7.leader_arm.interrupted.json"
