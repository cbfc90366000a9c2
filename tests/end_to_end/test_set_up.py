"""The README's two commands on a machine that has only Python, and on one that has less."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OLD = '#!/bin/sh\n[ "$1" = --version ] && echo Python 3.8.1\nexit 1\n'
WITHOUT_VENV = '#!/bin/sh\n[ "$1" = -m ] && { echo "No module named venv" >&2; exit 1; }\nexit 0\n'


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A copy of what git tracks, as a fresh clone has it."""
    folder = tmp_path / "clone"
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    for name in filter(None, listing.split("\0")):
        source, target = ROOT / name, folder / name
        if os.path.lexists(source):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)
    return folder


def start(
    clone: Path, *words: str, path: str | None = None, timeout_s: float = 60, **variables: str
) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PYTHON")}
    environment |= {"PATH": path or os.environ["PATH"]} | variables
    return subprocess.run(
        [clone / words[0], *words[1:]],
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=timeout_s,
    )


def tools_only(tmp_path: Path, **programs: str) -> str:
    """A PATH with the tools of any machine and the given programs, and no other."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in ("sh", "dirname", "basename", "cat", "cksum"):
        (folder / tool).symlink_to(shutil.which(tool) or tool)
    for name, text in programs.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    return str(folder)


@pytest.mark.parametrize("command", ["run", "test"])
def test_a_machine_without_python_is_told_what_to_install(clone: Path, tmp_path: Path, command: str):
    result = start(clone, command, path=tools_only(tmp_path))
    assert result.returncode == 3
    assert result.stderr.startswith(f"{command}: Python is not installed\n  needed: Python 3.10 or newer")
    assert "sudo apt install python3 python3-venv" in result.stderr


def test_a_python_that_is_too_old_is_named(clone: Path, tmp_path: Path):
    result = start(clone, "run", path=tools_only(tmp_path, python3=OLD))
    assert result.returncode == 3
    assert "run: Python is too old: found Python 3.8.1, needed 3.10 or newer\n" in result.stderr
    assert "PYTHON=/path/to/python3.11" in result.stderr


def test_a_python_that_was_asked_for_and_is_too_old_is_named(clone: Path, tmp_path: Path):
    path = tools_only(tmp_path, ancient=OLD)
    result = start(clone, "run", path=path, PYTHON="ancient")
    assert result.returncode == 3
    assert "PYTHON=ancient is not a Python 3.10 or newer\n  found: Python 3.8.1\n" in result.stderr


def test_a_python_without_venv_is_told_which_package_brings_it(clone: Path, tmp_path: Path):
    result = start(clone, "run", path=tools_only(tmp_path, python3=WITHOUT_VENV))
    assert result.returncode == 3
    assert "No module named venv" in result.stderr
    assert "sudo apt install python3-venv" in result.stderr


def test_an_active_environment_that_is_too_old_is_named(clone: Path, tmp_path: Path):
    environment = tmp_path / "venv"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin/python").write_text(OLD)
    (environment / "bin/python").chmod(0o755)
    result = start(clone, "run", VIRTUAL_ENV=str(environment))
    assert result.returncode == 3
    assert f"the active virtual environment is older than Python 3.10: {environment}" in result.stderr


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_both_commands_set_themselves_up_in_a_fresh_clone(clone: Path):
    """The first run installs, the second does not; the test command gets as far as its sessions."""
    first = start(clone, "run", "--validate-only", timeout_s=400, PYTHON=sys.executable)
    assert first.returncode == 0, first.stderr
    assert first.stdout.endswith("test_mock_hardware.pbtxt: valid\n")
    assert "Making the virtual environment .venv with Python 3" in first.stderr
    assert "Installing joshua-core into" in first.stderr

    second = start(clone, "run", "--validate-only", PYTHON=sys.executable)
    assert (second.returncode, second.stdout, second.stderr) == (0, first.stdout, "")

    sessions = start(clone, "test", "--list", timeout_s=200, PYTHON=sys.executable)
    assert sessions.returncode == 0, sessions.stderr
    for name in ("lint", "types", "proto", "docs", "tests"):
        assert f"* {name} -> " in sessions.stdout
    assert "- bench -> " in sessions.stdout
