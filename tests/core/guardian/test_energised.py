"""Records of actuators with torque: who writes them, when they go, and that a full disk does not matter."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.guardian.energised import EnergisedFolder, EnergisedNote, EnergisedRecord, remove_record

RECORD = EnergisedRecord(
    node="/left/arm",
    robot="so-arm100",
    source="/robots/teleop.pbtxt",
    domain_id=7,
    run="1a2b3c4d",
    implementation="arms:Stop",
    request={"action": "RELEASE", "ids": [1, 2]},
    options=("--set", "general.id=x"),
)


@pytest.fixture
def folder(tmp_path: Path) -> EnergisedFolder:
    return EnergisedFolder(tmp_path / "energised")


def note(folder: EnergisedFolder, record: EnergisedRecord = RECORD) -> EnergisedNote:
    run = folder.path.parent / record.run
    return EnergisedNote(str(folder.path), str(run), record)


def test_a_record_stands_from_torque_on_to_torque_off(folder: EnergisedFolder) -> None:
    own = note(folder)
    own.prepare()
    assert folder.all() == []
    own.energising()
    (found,) = folder.all()
    assert replace(found, since="") == RECORD
    assert found.since
    own.released()
    own.released()
    assert folder.all() == []


def test_torque_on_and_off_again_writes_nothing(folder: EnergisedFolder) -> None:
    """What a full disk refuses is a new file; a rename it takes."""
    own = note(folder)
    own.prepare()
    (spare,) = (folder.path.parent / RECORD.run).iterdir()
    number = spare.stat().st_ino
    for _ in range(2):
        own.energising()
        assert [path.stat().st_ino for path in folder.path.iterdir()] == [number]
        own.released()
        assert spare.stat().st_ino == number


def test_an_older_record_stands_until_torque_is_off(folder: EnergisedFolder) -> None:
    former = note(folder, replace(RECORD, run="former"))
    former.prepare()
    former.energising()
    own = note(folder)
    own.prepare()
    assert [record.run for record in folder.all()] == ["former"]
    own.energising()
    assert [record.run for record in folder.all()] == [RECORD.run]


def test_a_run_whose_directory_was_removed_still_keeps_it(folder: EnergisedFolder) -> None:
    own = note(folder)
    own.prepare()
    (spare,) = (folder.path.parent / RECORD.run).iterdir()
    spare.unlink()
    own.energising()
    assert len(folder.all()) == 1


def test_a_record_that_vanished_with_its_folder_is_written_again(folder: EnergisedFolder) -> None:
    own = note(folder)
    own.prepare()
    own.keep()
    assert folder.all() == []
    own.energising()
    for path in (folder.path, folder.path.parent / RECORD.run):
        shutil.rmtree(path)
    own.keep()
    assert len(folder.all()) == 1
    own.released()
    own.keep()
    assert folder.all() == []


def test_two_robots_with_the_same_node_have_two_records(folder: EnergisedFolder) -> None:
    for robot in ("one", "two"):
        own = note(folder, replace(RECORD, robot=robot, run=robot))
        own.prepare()
        own.energising()
    assert {record.robot for record in folder.all()} == {"one", "two"}


def test_a_guardian_removes_it_by_its_path(folder: EnergisedFolder) -> None:
    own = note(folder)
    own.prepare()
    own.energising()
    for _ in range(2):
        remove_record(own.path)
    assert folder.all() == []


def test_damaged_and_foreign_files_are_left_out(folder: EnergisedFolder) -> None:
    own = note(folder)
    own.prepare()
    own.energising()
    (path,) = folder.path.iterdir()
    (folder.path / "other.json").write_text(path.read_text())
    (folder.path / "torn.json").write_text(path.read_text()[:20])
    (folder.path / "list.json").write_text("[]")
    assert len(folder.all()) == 1


def test_a_run_of_emulated_devices_keeps_none(tmp_path: Path) -> None:
    own = EnergisedNote("", str(tmp_path / "run"), RECORD)
    own.prepare()
    own.energising()
    own.released()
    assert (own.path, list(tmp_path.iterdir())) == ("", [])
