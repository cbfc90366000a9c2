"""Temporary files of a training: nothing that a killed process leaves stays for long."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from joshua_imitation.scratch import LOCK, Scratch
from joshua_training.run_folder import RunError

PROGRAM = """
import sys
from joshua_imitation.scratch import Scratch
scratch = Scratch("joshua-pictures")
(scratch.path / "0.raw").write_bytes(bytes(1000))
print(scratch.path, flush=True)
sys.stdin.read()
scratch.close()
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_what_a_killed_process_leaves_is_removed_by_the_next(place: Path) -> None:
    runs = [
        subprocess.Popen([sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    folders = []
    for run in runs:
        assert run.stdout is not None
        folders.append(Path(run.stdout.readline().decode().strip()))
    foreign = place / "joshua-pictures-of-the-holidays"
    foreign.mkdir()
    runs[0].kill()
    runs[0].communicate()
    assert (folders[0] / "0.raw").is_file()
    own = Scratch("joshua-stream")
    assert set(place.iterdir()) == {own.path, folders[1], foreign}
    assert (folders[1] / "0.raw").is_file()
    runs[1].communicate()
    assert runs[1].returncode == 0
    own.close()
    own.close()
    assert set(place.iterdir()) == {foreign}


def test_a_folder_that_is_not_locked_by_its_file_is_left_alone(place: Path) -> None:
    """A link may point anywhere."""
    (place / "target").mkdir()
    (place / "target" / "kept").touch()
    (place / "joshua-link").mkdir()
    (place / "joshua-link" / LOCK).symlink_to(place / "target" / "kept")
    Scratch("joshua-stream").close()
    assert (place / "joshua-link").is_dir()
    assert (place / "target" / "kept").is_file()


def test_a_folder_that_is_gone_is_named(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(place / "gone"))
    with pytest.raises(
        RunError, match=r"gone cannot be written: No such .*, or set TMPDIR to another folder"
    ):
        Scratch("joshua-pictures")
