"""``joshua find-cameras`` on emulated devices, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest
from emulated_v4l2 import EmulatedDevices
from joshua_emulator.camera.frame_code import read_code

BY_ID = "usb-Emulated_Camera_0_0001-video-index0"

PROGRAM = """
import sys
from functools import partial
from pathlib import Path
from joshua_camera import survey
# the folder that stands for the root of this machine's files
survey.survey.__defaults__ = (None, Path(sys.argv[1]))
from joshua.cli.main import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture
def root(devices: EmulatedDevices, frame: bytes, tmp_path: Path) -> Path:
    """A machine with a camera, its metadata node, a busy camera and a forbidden one."""
    devices.add(0, frame=frame)
    devices.add(1, "metadata")
    devices.add(2, "busy", frame=frame)
    devices.add(3, "deny", frame=frame)
    root = tmp_path / "root"
    by_id = root / "dev/v4l/by-id"
    by_id.mkdir(parents=True)
    for number in range(4):
        (root / f"dev/video{number}").touch()
    (by_id / BY_ID).symlink_to("../../video0")
    return root


def find_cameras(devices: EmulatedDevices, root: Path, *arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(root), "find-cameras", *arguments],
        env=devices.environment(),
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert not done.stderr, done.stderr
    return done.returncode, done.stdout


def test_the_list_says_what_to_write_and_what_is_wrong(devices: EmulatedDevices, root: Path) -> None:
    code, text = find_cameras(devices, root)
    assert code == 0
    first, busy, forbidden = text.split("\n\n") if "\n\n" in text else text.strip().split(f"\n{root}")
    assert f'  source: "{BY_ID}"' in first
    assert "Emulated Camera 0" in first
    assert "  MJPG  640 × 480  30, 15 Hz" in first
    assert "  YUYV  640 × 480  30 Hz" in first
    assert "  device_id: 2" in busy
    assert "problem" not in busy  # a busy camera can be asked, but gives no picture
    assert "may not be opened by this user: add the user to the group video" in forbidden
    assert "video1" not in text


def test_pictures_are_saved(devices: EmulatedDevices, root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    code, text = find_cameras(devices, root, "--save", str(folder), "--format", "json")
    assert code == 0
    good, busy, forbidden = json.loads(text)
    assert good["source"] == BY_ID
    assert good["device_id"] == 0
    assert good["formats"][0]["sizes"][0] == {"width": 640, "height": 480, "rates_hz": [30, 15]}
    picture: Any = cv2.imread(good["picture"])
    code_shown = read_code(picture)
    assert code_shown is not None
    assert code_shown.number == 77
    assert "is in use by another process" in busy["problem"]
    assert forbidden["picture"] == ""


def test_a_folder_that_cannot_be_written(devices: EmulatedDevices, root: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    done = subprocess.run(
        [sys.executable, "-m", "joshua.cli.main", "find-cameras", "--save", str(tmp_path / "file" / "x")],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 2
    assert "cannot be written: not a directory" in done.stderr
