"""What the program prints about names that others chose: no control character, no secret."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOKEN = "hf_0123456789abcdefghij"
NAME = f"\x1b]0;owned\x07\x1b[2J\r{TOKEN}\x9b31m\u202e"


@pytest.mark.parametrize(
    "words",
    [
        ("--validate-only", "--config", f"{NAME}.pbtxt"),
        ("--config", f"{NAME}.pbtxt"),
        ("dataset", "check", NAME),
        ("dataset", "repair", NAME),
        ("status", NAME),
        ("explain", NAME),
        (NAME,),
    ],
    ids=lambda words: " ".join(word for word in words if TOKEN not in word),
)
def test_foreign_names_neither_control_the_terminal_nor_show_a_token(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    environment = {**os.environ, "HF_TOKEN": TOKEN, "PYTHONIOENCODING": "utf-8"}
    command = [sys.executable, "-m", "joshua", *words]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)
    said = (done.stdout + done.stderr).decode()
    assert done.returncode != 0
    assert said
    assert not set(said) & {"\x1b", "\x07", "\r", "\x9b", "\u202e"}
    assert TOKEN not in said
