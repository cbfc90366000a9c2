"""``joshua plan`` in a terminal."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest
from joshua.cli.main import main

PRESET = Path(__file__).parents[4] / "configs" / "test_mock_hardware.pbtxt"


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("output", [Tty(), io.StringIO()], ids=lambda output: type(output).__name__)
def test_lines_are_wrapped_where_there_is_a_terminal(
    output: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setattr(sys, "stdout", output)
    assert main(["plan", str(PRESET)]) == 0
    lines = output.getvalue().splitlines()
    assert (max(map(len, lines)) <= 60) is output.isatty()
    assert ("             [sensor_msgs/msg/JointState]" in output.getvalue()) is output.isatty()
