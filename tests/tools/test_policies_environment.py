"""``tools/policies.sh`` installs the tested versions in their order, and this project from the clone."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "tools" / "policies.sh"

# Stands for Python: it logs what it is asked, and «makes» environments that hold a copy of itself.
PYTHON = """#!/bin/sh
printf '%s\\n' "$*" >>"$LOG"
if [ "$2" = venv ]; then mkdir -p "$3/bin" && cp "$0" "$3/bin/python"; fi
"""


# The same, and it fails where the words contain those of FAIL.
FAILING = (
    PYTHON
    + """case "$*" in *"$FAIL"*) exit 1 ;; esac
"""
)


def run(folder: Path, *words: str, python: str = "") -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "LOG": str(folder / "log"), "PYTHON": python}
    return subprocess.run(
        [str(SCRIPT), *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_versions_and_plugins_are_installed_in_their_order(tmp_path: Path):
    stand_in = tmp_path / "python"
    stand_in.write_text(PYTHON)
    stand_in.chmod(0o755)
    done = run(tmp_path, "made", "--only-binary", "torch", python=str(stand_in))
    assert done.returncode == 0, done.stderr
    assert "1 GB for a processor, up to 9 GB for CUDA" in done.stderr
    assert f'python: "{tmp_path}/made/bin/python"' in done.stderr
    venv, torch, pins, ours, checked = (tmp_path / "log").read_text().splitlines()
    assert venv == "-m venv made"
    assert torch == (
        "-m pip install --quiet torch==2.14.1 torchvision==0.29.1 torchcodec==0.17.0 --only-binary torch"
    )
    assert checked == f"{ROOT}/tools/check_policies.py"
    assert pins == f"-m pip install --quiet --no-deps -r {ROOT}/constraints-learn.txt"
    assert ours.startswith(f"-m pip install --quiet --no-deps -e {ROOT}/joshua-core -e ")
    names = [part.rpartition("/")[2] for part in ours.split(" -e ")[2:]]
    assert names == [
        "calibration",
        "dataset",
        "evaluation",
        "imitation",
        "inference",
        "jobs",
        "lerobot",
        "mujoco-sim",
        "onnx",
        "ppo-trainer",
        "ray",
        "services",
        "smolvla",
        "teleop-input",
        "training",
    ]


@pytest.mark.parametrize(
    ("words", "python", "code", "said"),
    [
        ((), "", 2, "name the folder of the environment"),
        (("--help",), "", 2, "next: tools/policies.sh policies"),
        (("made",), "no-such-python", 3, "no-such-python is not installed, and the versions were tested on"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, words: tuple[str, ...], python: str, code: int, said: str):
    done = run(tmp_path, *words, python=python)
    assert done.returncode == code
    assert said in done.stderr


@pytest.mark.parametrize(
    ("step", "said"),
    [
        ("venv made", "the environment made cannot be made"),
        (
            "pip install --quiet torch==",
            "pip cannot install torch==2.14.1 torchvision==0.29.1",
        ),
        ("--no-deps -r", "pip cannot install LeRobot and what it needs"),
        ("--no-deps -e", "pip cannot install the plugins of this clone"),
        ("check_policies.py", "made was made, but it cannot run policies"),
    ],
)
def test_the_step_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, said: str):
    stand_in = tmp_path / "python"
    stand_in.write_text(FAILING)
    stand_in.chmod(0o755)
    monkeypatch.setenv("FAIL", step)
    done = run(tmp_path, "made", python=str(stand_in))
    assert done.returncode == 3
    assert said in done.stderr
    assert "runs it there" not in done.stderr
