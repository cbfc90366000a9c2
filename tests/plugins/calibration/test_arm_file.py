"""The calibration file: one entry changes, everything else stays as its author wrote it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua.config import load
from joshua.devices.calibration import ArmCalibration, MotorCalibration
from joshua.planner.calibration_place import FileRefused
from joshua_calibration.arm_file import ArmFile

MOTORS = (
    MotorCalibration(id=1, joint_name="pan", homing_offset=-12, range_min=100, range_max=4000),
    MotorCalibration(id=2, joint_name='odd "name"', range_max=4095, inverted=True),
)
NEW = ArmCalibration(motors=MOTORS, device_identity="usb:A", calibrated_at="2026-01-31T12:00:00Z")
OTHER = """# my two arms
general { name: "kept" }  # as it is

calibration {
  arms { node_name: "follower_arm" motors { id: 9 joint_name: "x" range_max: 7 } }  # the old one
  %s
}
# the end
"""


def save(file: ArmFile, node_name: str = "leader_arm", calibration: ArmCalibration = NEW) -> str:
    file.prepare(node_name, calibration).commit()
    return file.path.read_text()


def test_a_new_file_holds_the_arm_and_says_what_it_is(tmp_path: Path):
    file = ArmFile(tmp_path / "calibration" / "rig.pbtxt")
    assert file.arm("leader_arm") is None
    text = save(file)
    assert text.startswith("# Calibration of the arms of one robot")
    assert file.arm("leader_arm") == NEW
    assert load(file.path).diagnostics == []


@pytest.mark.parametrize(
    "entry",
    [
        "",
        'arms { node_name: "leader_arm" motors { id: 1 joint_name: "old" range_max: 9 } }',
        "arms: { node_name: 'leader' '_arm' motors { id: 1 joint_name: \"old\" range_max: 9 } }",
        'arms: [{ node_name: "leader_arm" }, { node_name: "third_arm" }]',
    ],
)
def test_only_the_entry_of_the_arm_changes(tmp_path: Path, entry: str):
    file = ArmFile(tmp_path / "rig.pbtxt")
    file.path.write_text(OTHER % entry)
    before = load(file.path).config
    text = save(file)
    assert file.arm("leader_arm") == NEW
    for kept in ("# my two arms\n", "# as it is", "# the old one", "# the end"):
        assert kept in text
    after = load(file.path).config
    assert after.general == before.general
    others = [arm for arm in before.calibration.arms if arm.node_name != "leader_arm"]
    assert [arm for arm in after.calibration.arms if arm.node_name != "leader_arm"] == others
    assert save(file) == text


def test_a_file_without_a_calibration_block_gets_one(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    file.path.write_text("# nothing yet")
    assert save(file).startswith("# nothing yet\n\ncalibration {\n  arms {\n    node_name:")
    assert file.arm("leader_arm") == NEW


def test_what_is_prepared_changes_nothing_before_it_is_committed(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    save(file)
    before = file.path.read_bytes()
    prepared = file.prepare("follower_arm", NEW)
    assert file.path.read_bytes() == before
    prepared.discard()
    prepared.discard()
    assert os.listdir(tmp_path) == ["rig.pbtxt"]


def test_two_runs_do_not_lose_each_others_entries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = ArmFile(tmp_path / "rig.pbtxt")
    (tmp_path / ".rig.pbtxt.killed.new").write_text("left over")
    first = file.prepare("leader_arm", NEW)
    monkeypatch.setattr("joshua_calibration.arm_file.LOCK_TIMEOUT_S", 0.1)
    with pytest.raises(FileRefused, match="another program is writing into its folder"):
        file.prepare("follower_arm", NEW)
    first.commit()
    save(file, "follower_arm")
    assert file.arm("leader_arm") == file.arm("follower_arm") == NEW
    assert os.listdir(tmp_path) == ["rig.pbtxt"]


def test_what_a_killed_run_left_is_swept(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    save(file)
    file.sweep()
    (tmp_path / ".rig.pbtxt.killed.new").write_text("left over")
    (tmp_path / ".other.pbtxt.killed.new").write_text("of another file")
    file.sweep()
    assert sorted(os.listdir(tmp_path)) == [".other.pbtxt.killed.new", "rig.pbtxt"]


def test_a_file_that_cannot_be_replaced_leaves_nothing_behind(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    prepared = file.prepare("leader_arm", NEW)
    (tmp_path / "rig.pbtxt").mkdir()
    with pytest.raises(FileRefused, match="cannot be replaced"):
        prepared.commit()
    assert os.listdir(tmp_path) == ["rig.pbtxt"]


def test_a_link_stays_a_link_and_the_mode_stays(tmp_path: Path):
    (tmp_path / "real.pbtxt").write_text("")
    (tmp_path / "real.pbtxt").chmod(0o640)
    (tmp_path / "link.pbtxt").symlink_to("real.pbtxt")
    save(ArmFile(tmp_path / "link.pbtxt"))
    assert (tmp_path / "link.pbtxt").is_symlink()
    assert (tmp_path / "real.pbtxt").stat().st_mode & 0o777 == 0o640


def test_a_broken_file_is_never_touched(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    file.path.write_text("calibration { arms { node_nam: }")
    for action in (lambda: file.prepare("a", NEW), lambda: file.arm("a")):
        with pytest.raises(
            FileRefused, match=r"rig\.pbtxt:1:\d+: .* Correct the calibration file, or move it"
        ):
            action()
    assert os.listdir(tmp_path) == ["rig.pbtxt"]


def test_an_entry_that_is_no_calibration_is_named(tmp_path: Path):
    file = ArmFile(tmp_path / "rig.pbtxt")
    file.path.write_text(
        'calibration { arms { node_name: "a" motors { id: 1 joint_name: "pan" range_min: 9 range_max: 3 } } }'
    )
    with pytest.raises(FileRefused, match="calibration of a cannot be used: pan: range_min 9 is not below"):
        file.arm("a")


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path):
    (tmp_path / "calibration").write_text("a file")
    with pytest.raises(FileRefused, match=r"calibration/rig\.pbtxt: cannot be written"):
        ArmFile(tmp_path / "calibration" / "rig.pbtxt").prepare("a", NEW)
