"""Rows of a run that goes on, whose file is cut when it is continued."""

from __future__ import annotations

from pathlib import Path

from joshua_ray.rows import Rows
from joshua_training.run_folder import RunFolder


def steps_of(rows: Rows, path: Path) -> list[int]:
    found = []
    while (row := rows.next(path)) is not None:
        found.append(row["steps"])
    return found


def test_a_row_is_read_when_its_line_is_complete(tmp_path: Path) -> None:
    rows, path = Rows(), tmp_path / "metrics.jsonl"
    assert rows.next(path) is None
    path.write_text('{"steps": 1}\n{"steps"')
    assert steps_of(rows, path) == [1]
    with path.open("a") as file:
        file.write(": 2}\n")
    assert steps_of(rows, path) == [2]


def test_a_continued_run_cuts_its_rows_and_computes_them_again(tmp_path: Path) -> None:
    rows, run = Rows(), RunFolder(tmp_path)
    path = tmp_path / "metrics.jsonl"
    for steps in (10, 20, 30):
        run.add_metrics({"steps": steps, "episode/return": 0.123456789})
    assert steps_of(rows, path) == [10, 20, 30]
    run.cut_metrics(10)
    assert steps_of(rows, path) == []
    for steps in (20, 30, 40):  # shorter, so the place reached is in the middle of a line
        run.add_metrics({"steps": steps, "episode/return": 1.0})
    assert steps_of(rows, path) == [40]


def test_a_file_that_is_cut_in_place_is_read_again(tmp_path: Path) -> None:
    rows, path = Rows(), tmp_path / "metrics.jsonl"
    path.write_text('{"steps": 1}\n{"steps": 2}\n')
    assert steps_of(rows, path) == [1, 2]
    with path.open("r+b") as file:
        file.truncate(13)
    assert steps_of(rows, path) == []
    with path.open("a") as file:
        file.write('{"steps": 2}\n{"steps": 3}\n')
    assert steps_of(rows, path) == [3]


def test_a_metric_is_missed_when_all_figures_are_there(tmp_path: Path) -> None:
    rows, run = Rows(), RunFolder(tmp_path)
    path, complete = tmp_path / "metrics.jsonl", ("episode/", "train/")
    for row in ({"train/loss": 1.0}, {"train/loss": 1.0, "episode/return": 2.0, "episode/length": 3.0}):
        assert rows.lacking("episode/retrun", complete) == ""  # no episode has ended yet
        run.add_metrics({"steps": 1, **row})
        assert steps_of(rows, path) == [1]
    assert rows.lacking("episode/return", complete) == ""
    assert rows.lacking("episode/retrun", complete) == (
        "its metrics have no episode/retrun: choose --metric from episode/return, episode/length, train/loss"
    )
    assert Rows().lacking("episode/return") == "its metrics have no episode/return"
