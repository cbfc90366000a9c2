"""The command ``joshua fmt``: in place, as a check, as a filter, and when a file cannot be formatted."""

from __future__ import annotations

import argparse
import io
import os
import stat
import sys
from pathlib import Path

import pytest
from joshua.cli.commands import fmt
from joshua.config import format_file

UGLY = "general{mode:MODE_TEST}# c\n"
NEAT = "general { mode: MODE_TEST }  # c\n"


def run(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    fmt.add_arguments(parser)
    return fmt.run(parser.parse_args(arguments))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "robot.pbtxt"
    path.write_text(UGLY)
    return path


def test_a_file_is_formatted_in_place_and_keeps_its_mode(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.chmod(0o640)
    assert run(str(path)) == 0
    assert path.read_text() == NEAT
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert capsys.readouterr().out == f"{path}: formatted\n"
    assert sorted(path.parent.iterdir()) == [path]


def test_a_formatted_file_is_not_touched(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path.write_text(NEAT)
    before = path.stat()
    assert run(str(path)) == 0
    assert path.stat().st_ino == before.st_ino
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert capsys.readouterr().out == ""


def test_a_link_stays_a_link(path: Path) -> None:
    link = path.parent / "link.pbtxt"
    link.symlink_to(path)
    assert run(str(link)) == 0
    assert link.is_symlink()
    assert path.read_text() == NEAT


def test_check_names_the_files_and_changes_none(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    neat = path.parent / "neat.pbtxt"
    neat.write_text(NEAT)
    assert run("--check", str(path), str(neat)) == 1
    assert capsys.readouterr().out == f"{path}: would be formatted\n"
    assert path.read_text() == UGLY
    assert run("--check", str(neat)) == 0


def test_line_ends_alone_are_a_change(path: Path) -> None:
    path.write_bytes(NEAT.replace("\n", "\r\n").encode())
    assert run("--check", str(path)) == 1
    assert run(str(path)) == 0
    assert path.read_bytes() == NEAT.encode()


def test_a_file_with_syntax_errors_is_left_as_it_is(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = path.parent / "good.pbtxt"
    good.write_text(UGLY)
    path.write_text("general { mode = MODE_TEST\n")
    assert run(str(path), str(good)) == 2
    shown = " ".join(capsys.readouterr().err.split())
    assert path.read_text() == "general { mode = MODE_TEST\n"
    assert f"{path}:1:16: error: mode is followed by '='" in shown
    assert "The block general is not closed." in shown
    assert f"joshua fmt: {path} stays unchanged" in shown
    assert good.read_text() == NEAT


def test_names_are_no_matter_of_layout(path: Path) -> None:
    path.write_text("nothing{like:this}")
    assert run(str(path)) == 0
    assert path.read_text() == "nothing { like: this }\n"


def test_a_missing_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(str(tmp_path / "none.pbtxt")) == 2
    assert "There is no file" in capsys.readouterr().err


def test_a_folder_is_an_error_that_lists_its_files(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(str(path.parent)) == 2
    assert "robot.pbtxt" in capsys.readouterr().err


class StandardInput:
    def __init__(self, data: bytes) -> None:
        self.buffer = io.BytesIO(data)


@pytest.mark.parametrize(
    ("text", "arguments", "code", "out"),
    [
        (UGLY, ["-"], 0, NEAT),
        (NEAT, ["-"], 0, NEAT),
        (UGLY, ["-", "--check"], 1, "<stdin>: would be formatted\n"),
        (NEAT, ["-", "--check"], 0, ""),
        ("a {", ["-"], 2, ""),
    ],
)
def test_standard_input_is_filtered(
    text: str,
    arguments: list[str],
    code: int,
    out: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "stdin", StandardInput(text.encode()))
    assert run(*arguments) == code
    assert capfd.readouterr().out == out


def test_a_failed_write_leaves_the_file_and_nothing_beside_it(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert run(str(path)) == 2
    assert path.read_text() == UGLY
    assert list(path.parent.iterdir()) == [path]
    assert f"{path} cannot be written: No space left on device" in capsys.readouterr().err


def test_a_result_that_says_something_else_is_refused(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(format_file, "format_source", lambda *_: "general {}\n")
    assert run(str(path)) == 2
    assert path.read_text() == UGLY
    assert "Formatting would change the content of" in capsys.readouterr().err
