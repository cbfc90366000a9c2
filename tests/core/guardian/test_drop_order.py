"""The order to drop parking joints, also on a full disk."""

from __future__ import annotations

from pathlib import Path

from joshua.guardian.drop_order import DropOrder


def test_the_order_is_given_once_for_every_guardian_of_the_run(tmp_path: Path) -> None:
    order, guardian = DropOrder(str(tmp_path / "estop")), DropOrder(str(tmp_path / "estop"))
    order.prepare()
    assert not guardian.given
    order.give()
    assert guardian.given
    order.give()
    assert guardian.given


def test_giving_it_makes_no_file(tmp_path: Path) -> None:
    """A full disk takes no new file, but a rename."""
    order = DropOrder(str(tmp_path))
    order.prepare()
    (spare,) = tmp_path.iterdir()
    number = spare.stat().st_ino
    order.give()
    assert [path.stat().st_ino for path in tmp_path.iterdir()] == [number]


def test_a_folder_that_was_emptied_or_removed_meanwhile_takes_the_order(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "estop"):
        order = DropOrder(str(folder))
        order.give()
        assert order.given


def test_a_run_without_directory_gives_none() -> None:
    order = DropOrder("")
    order.prepare()
    order.give()
    assert not order.given
