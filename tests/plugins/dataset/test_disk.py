"""A disk that becomes read-only or is lost under a recording."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import read_only_disk
from joshua.api import RefusedError
from joshua_dataset import disk
from joshua_dataset.files import reason


def test_a_disk_that_becomes_read_only_in_mid_episode(tmp_path: Path) -> None:
    """The finished part is intact, the message is clear, and the node goes on; a real disk of the kernel."""
    image, place = tmp_path / "disk", tmp_path / "place"
    place.mkdir()
    with image.open("wb") as file:
        file.truncate(1 << 30)  # a hole: takes no space
    tools = ("mkfs.ext4", "unshare", "mount")
    if os.getuid() or not all(shutil.which(name) for name in tools) or not Path("/dev/loop0").exists():
        pytest.skip("mounting a disk requires root, a loop device and mkfs.ext4")
    subprocess.run(["mkfs.ext4", "-q", "-F", image], check=True)
    command = ["unshare", "--mount", sys.executable, read_only_disk.__file__, str(image), str(place)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    remedy = "The disk is read-only: `dmesg` says why. Mount it again"
    found: dict[str, Any] = json.loads(done.stdout)
    for form, what in (("lerobot", "frame"), ("mcap", "message of /[a-z_/]+")):
        end = found[form]
        begin = (
            f"episode 1 ended early: {re.escape(str(place / form))} takes no {what}: \\[Errno 30\\] "
            "Read-only file system"
        )
        assert re.match(begin, end["message"]), end["message"]
        assert end["message"].endswith(remedy)
        assert "keep them with `joshua record keep`, or discard them" in done.stderr
        assert end["refused"].startswith(
            f"{place / form} cannot be written: [Errno 30] Read-only file system"
        )
        assert end["refused"].endswith(remedy)
        assert (end["phase"], end["kept"], end["failures"]) == ("stopped", 1, [])
        assert end["length"] >= 10
    assert found["lerobot"]["pictures"] == found["lerobot"]["length"]
    assert "Traceback" not in done.stderr


def test_an_error_of_the_disk_names_its_remedy() -> None:
    assert reason(OSError(30, "Read-only file system")).endswith("`dmesg` says why. Mount it again")
    assert reason(OSError(5, "Input/output error")).endswith("error. Check the disk and its cable")
    assert reason(OSError(13, "Permission denied")).endswith("Make it readable and writable for your user")
    assert reason(OSError(28, "No space left on device")).endswith("device. Free some space")
    assert reason(OSError(2, "No such file or directory")) == "[Errno 2] No such file or directory"
    assert reason(ValueError("no number")) == "no number"


def test_a_lost_disk_ends_an_episode(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert disk.shortage(tmp_path / "set") == ""

    def lost(path: Path) -> Any:
        raise OSError(5, "Input/output error", str(path))

    monkeypatch.setattr(shutil, "disk_usage", lost)
    assert disk.free_bytes(tmp_path / "set") == 0
    assert disk.shortage(tmp_path / "set").startswith("the disk is full or lost")
    with pytest.raises(RefusedError, match="has 0 MB left; free some space, at least 500 MB"):
        disk.require_space(tmp_path / "set")
