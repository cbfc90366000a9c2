"""The command ``joshua explain``: pages on standard output, unknown names on standard error."""

from __future__ import annotations

import argparse

import pytest
from joshua.cli.commands import explain


def run(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    explain.add_arguments(parser)
    return explain.run(parser.parse_args(arguments))


def test_without_a_name_the_blocks_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run() == 0
    assert "general" in capsys.readouterr().out


def test_a_name_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("general.mode") == 0
    assert "MODE_TELEOPERATE" in capsys.readouterr().out


def test_plugins_are_asked_for_blocks_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("robot.actions.plugin_config") == 0
    assert "plugin" in capsys.readouterr().out


def test_an_unknown_name_ends_with_the_nearest_and_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("general.mod") == 2
    assert capsys.readouterr().err == (
        "joshua explain: nothing is named 'general.mod'\n"
        "  nearest: general.mode\n"
        "  do:      run `joshua explain` for the blocks of a file\n"
    )
