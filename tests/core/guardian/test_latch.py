from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.guardian.latch import EstopFiles, EstopOrder, EstopReport, LatchFolder, Subject, new_latch
from small_disk import SmallDisk, small_disk

ARM = Subject("desk", 5, "/arm")


def test_a_latch_covers_its_robot_and_its_nodes_and_nothing_else(tmp_path: Path) -> None:
    folder = LatchFolder(tmp_path / "estop")
    assert folder.standing(ARM) is None
    latch = folder.set("desk", "/desk.pbtxt", 5, ["/arm"])
    assert folder.standing(ARM) == latch
    assert folder.standing(Subject("desk", 9, "/other")) == latch, "the robot in another domain"
    assert folder.standing(Subject("", 5, "/arm")) == latch, "the node in a file without id"
    assert folder.standing(Subject("", 9, "/arm")) is None
    assert folder.standing(Subject("shelf", 9, "/arm")) is None
    folder.clear(latch)
    folder.clear(latch)
    assert folder.standing(ARM) is None


def test_other_programs_see_it_at_once_and_a_second_one_takes_its_place(tmp_path: Path) -> None:
    mine, theirs = LatchFolder(tmp_path / "estop"), LatchFolder(tmp_path / "estop")
    first = mine.set("desk", "/desk.pbtxt", 5, ["/arm"])
    assert theirs.standing(ARM) == first
    second = theirs.set("desk", "/desk.pbtxt", 5, ["/arm"])
    assert mine.standing(ARM) == second
    assert mine.all() == [second]
    other = mine.set("shelf", "/shelf.pbtxt", 5, ["/lift"])
    assert {latch.identifier for latch in mine.all()} == {second.identifier, other.identifier}


def test_files_are_private_and_whole(tmp_path: Path) -> None:
    folder = LatchFolder(tmp_path / "estop")
    folder.set("desk", "/desk.pbtxt", 5, ["/arm"])
    (path,) = (tmp_path / "estop").iterdir()
    assert path.stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "estop").stat().st_mode & 0o777 == 0o700


def test_a_latch_that_cannot_be_read_stops_everything(tmp_path: Path) -> None:
    folder = LatchFolder(tmp_path / "estop")
    folder.path.mkdir()
    (folder.path / "abc.json").write_text("{")
    latch = folder.standing(ARM)
    assert latch is not None
    assert str(folder.path / "abc.json") in latch.text
    folder.clear(latch)
    assert folder.standing(ARM) is None


def test_reports_of_another_estop_do_not_count(tmp_path: Path) -> None:
    files = EstopFiles(str(tmp_path / "estop"))
    report = EstopReport("1", "/left/arm", "driver", True, True, {"pan": "released"})
    assert files.read_report("/left/arm", "1") is None
    files.report(report)
    assert files.read_report("/left/arm", "1") == report
    assert files.read_report("/left/arm", "2") is None
    (tmp_path / "estop" / "left.arm.report.json").write_text('{"latch": "1", "nonsense": 2}')
    assert files.read_report("/left/arm", "1") is None


def test_orders_are_found_again(tmp_path: Path) -> None:
    files = EstopFiles(str(tmp_path / "estop"))
    assert files.read_order("/arm") is None
    order = EstopOrder("acme.arm:stop", {"ids": [1]}, [{"process_id": 7}])
    files.leave_order("/arm", order)
    assert files.read_order("/arm") == order
    assert files.read_report("/arm", "1") is None


def test_a_run_without_directory_writes_nothing() -> None:
    files = EstopFiles("")
    files.leave_order("/arm", EstopOrder("acme.arm:stop", {}))
    assert files.read_order("/arm") is None


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk", size_bytes=256 * 1024, inodes=200) as disk:
        yield disk


def test_without_space_the_spare_file_becomes_a_latch_for_every_actuator(disk: SmallDisk) -> None:
    folder = LatchFolder(disk.path / "estop")
    folder.keep_spare()
    folder.keep_spare()
    disk.fill()
    with pytest.raises(OSError, match="\\[Errno") as caught:
        folder.set("desk", "/desk.pbtxt", 5, ["/arm"])
    assert caught.value.errno == errno.ENOSPC
    latch = folder.set_without_space(new_latch("desk", "/desk.pbtxt", 5, ["/arm"]))
    assert not latch.has_content
    assert folder.standing(Subject("another", 9, "/lift")) == latch
    assert "counts for every actuator" in latch.text
    assert sorted(os.listdir(folder.path)) == [f"{latch.identifier}.json"]

    again = folder.set_without_space(new_latch("another", "/other.pbtxt", 9, ["/lift"]))
    assert again.identifier != latch.identifier, "drivers obey each e-stop by its identifier"
    assert folder.all() == [again]
    folder.clear(again)
    assert folder.all() == []
    assert not folder.set_without_space(new_latch("desk", "/desk.pbtxt", 5, ["/arm"])).has_content


def test_without_space_an_older_latch_of_the_robot_is_renamed_and_keeps_its_content(disk: SmallDisk) -> None:
    folder = LatchFolder(disk.path / "estop")
    folder.keep_spare()
    older = folder.set("desk", "/desk.pbtxt", 5, ["/arm"])
    disk.fill()
    latch = folder.set_without_space(new_latch("desk", "/desk.pbtxt", 5, ["/arm"]))
    assert latch == replace(older, identifier=latch.identifier)
    assert folder.all() == [latch]
    assert folder.standing(Subject("another", 9, "/lift")) is None
    other = folder.set_without_space(new_latch("another", "/other.pbtxt", 9, ["/lift"]))
    assert not other.has_content, "that of another robot is of no use"
    assert latch in folder.all()


def test_a_released_latch_leaves_no_content_in_the_spare_file(disk: SmallDisk) -> None:
    folder = LatchFolder(disk.path / "estop")
    folder.clear(folder.set("desk", "/desk.pbtxt", 5, ["/arm"]))
    disk.fill()
    latch = folder.set_without_space(new_latch("another", "/other.pbtxt", 9, ["/lift"]))
    assert folder.standing(Subject("another", 9, "/lift")) == latch


def test_a_read_only_folder_takes_no_latch(disk: SmallDisk) -> None:
    folder = LatchFolder(disk.path / "estop")
    folder.keep_spare()
    disk.make_read_only()
    for refused in (
        lambda: folder.set("desk", "/desk.pbtxt", 5, ["/arm"]),
        lambda: folder.set_without_space(new_latch("desk", "/desk.pbtxt", 5, ["/arm"])),
    ):
        with pytest.raises(OSError, match="\\[Errno") as caught:
            refused()
        assert caught.value.errno == errno.EROFS
    folder.keep_spare()
    folder.clear(new_latch("desk", "/desk.pbtxt", 5, ["/arm"]))  # there is none to release


def test_reports_and_orders_are_written_without_space_after_the_first_order(disk: SmallDisk) -> None:
    files = EstopFiles(str(disk.path / "files"))
    order = EstopOrder("acme.arm:stop", {"ids": [1]})
    files.leave_order("/arm", order)
    assert files.has_order("/arm")
    disk.fill()
    long = EstopReport("1", "/arm", "driver", False, False, {f"joint_{n}": "released" for n in range(50)})
    short = EstopReport("2", "/arm", "guardian", True, True)
    for report in (long, short):
        assert files.report(report)
        assert files.read_report("/arm", report.latch) == report
    changed = replace(order, processes=[{"process_id": 7}])
    files.leave_order("/arm", changed)
    assert files.read_order("/arm") == changed
    with pytest.raises(OSError, match="No space left"):
        files.leave_order("/other", order)
    assert not files.report(EstopReport("1", "/other", "driver", True, True))
    disk.free()
    (disk.path / "files" / "arm.report.json").unlink()
    assert not files.has_order("/arm")
