from __future__ import annotations

from pathlib import Path

from joshua.guardian.latch import EstopFiles, EstopOrder, EstopReport, LatchFolder, Subject

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
