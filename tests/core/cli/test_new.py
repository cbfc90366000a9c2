from __future__ import annotations

import argparse
import os
from pathlib import Path

import pytest
from google.protobuf import text_format
from joshua.cli.commands import new as command
from joshua.cli.presets import preset_names, read_preset
from joshua.schema import config_pb2 as pb


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(words))


def parse(text: str) -> pb.Config:
    return text_format.Parse(text, pb.Config())


@pytest.mark.parametrize("preset", preset_names())
def test_the_copy_differs_in_name_and_id_only(preset: str):
    assert run("my_robot", "--from", preset) == 0
    copy = parse(Path("my_robot.pbtxt").read_text())
    assert (copy.general.name, copy.general.id) == ("my_robot", "my_robot")
    original = parse(read_preset(preset).text)
    original.general.name = original.general.id = "my_robot"
    assert copy == original


def test_the_copy_speaks_of_itself_and_the_next_steps_are_said(capsys: pytest.CaptureFixture[str]):
    assert run("my_robot.pbtxt", "--from", "teleop_so_arm100.pbtxt") == 0
    assert "# Run:     joshua --config my_robot.pbtxt\n" in Path("my_robot.pbtxt").read_text()
    out = capsys.readouterr().out
    assert out.startswith(
        "my_robot.pbtxt written, from the preset teleop_so_arm100\n  change: the two serial"
    )
    assert "  needs:  joshua-sts3215 (installed)\n" in out
    assert "  check:  joshua --config my_robot.pbtxt --validate-only\n" in out


def test_files_of_one_robot_share_an_id():
    assert run("calibrate", "--from", "calibrate_so_arm100", "--id", "my_robot") == 0
    general = parse(Path("calibrate.pbtxt").read_text()).general
    assert (general.name, general.id) == ("calibrate", "my_robot")


def test_a_file_that_is_there_stays_unless_forced(capsys: pytest.CaptureFixture[str]):
    Path("mine.pbtxt").write_text("precious")
    assert run("mine", "--from", "test_camera") == 2
    assert Path("mine.pbtxt").read_text() == "precious"
    assert capsys.readouterr().err == (
        "joshua new: mine.pbtxt exists already, so nothing was written\n"
        "  choose another name, or replace the file with --force\n"
    )
    assert run("mine", "--from", "test_camera", "--force") == 0
    assert parse(Path("mine.pbtxt").read_text()).general.name == "mine"


def test_a_misspelt_preset_names_the_nearest(capsys: pytest.CaptureFixture[str]):
    assert run("mine", "--from", "test_camra") == 2
    err = capsys.readouterr().err
    assert err.startswith("joshua new: no preset is named 'test_camra'\n  nearest: test_camera")
    assert not Path("mine.pbtxt").exists()


def test_without_a_preset_one_is_proposed(capsys: pytest.CaptureFixture[str]):
    assert run("mine") == 2
    assert capsys.readouterr().err == (
        "joshua new: no preset given\n"
        "  name one: joshua new mine --from test_mock_hardware\n"
        "  see: joshua presets\n"
    )


@pytest.mark.parametrize("name", ["../up", "a b", "", 'x"y', "-x", "ünder"])
def test_a_name_that_is_no_name_is_refused(name: str, capsys: pytest.CaptureFixture[str]):
    assert run("--from", "test_camera", "--", name) == 2
    assert "allowed: letters, digits, _ and -" in capsys.readouterr().err
    assert os.listdir() == []


def test_a_folder_in_the_way_is_named(capsys: pytest.CaptureFixture[str]):
    Path("mine.pbtxt").mkdir()
    assert run("mine", "--from", "test_camera", "--force") == 2
    assert "mine.pbtxt cannot be written: Is a directory" in capsys.readouterr().err
