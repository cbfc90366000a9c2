"""Emulated V4L2 devices, and programs that run on them.

``tests/plugins/camera/v4l2/emulated_v4l2.c`` reads the descriptions that are written here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

BRIGHTNESS, AUTO_EXPOSURE, EXPOSURE = 0x00980900, 0x009A0901, 0x009A0902

MODES = ("MJPG 640 480 30", "MJPG 640 480 15", "MJPG 320 240 30", "YUYV 640 480 30")
CONTROLS = (
    f"{BRIGHTNESS} 0 255 1 128",
    f"{AUTO_EXPOSURE} 0 3 1 3",
    f"{EXPOSURE} 3 2047 1 250",
)

_PROGRAM = """
import json, sys, threading, time
from joshua.schema import config_pb2
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_camera.camera import OpenCvCamera
from joshua_camera.settings import CameraSettings

def camera(**fields):
    block = config_pb2.CameraConfig(**{{"width": 640, "height": 480, "fps": 30, **fields}})
    return OpenCvCamera(CameraSettings.from_block(block))

def refusal(**fields):
    try:
        camera(**fields).connect()
    except DeviceError as error:
        return str(error)
    return "connected"

answer = {{}}
{body}
print("ANSWER " + json.dumps(answer), flush=True)
"""


class EmulatedDevices:
    """A folder of emulated devices, and the library that shows them to a program."""

    def __init__(self, folder: Path, library: Path) -> None:
        self.folder = folder
        self._library = library

    def add(
        self,
        number: int = 0,
        *extra: str,
        modes: Sequence[str] = MODES,
        controls: Sequence[str] = CONTROLS,
        frame: bytes = b"",
    ) -> None:
        """Adds /dev/video``number``; ``extra`` are lines such as ``busy``, ``deny``, ``delay_us 20000``."""
        lines = [*(f"mode {mode}" for mode in modes), *(f"control {entry}" for entry in controls), *extra]
        (self.folder / f"video{number}").write_text("\n".join(lines) + "\n")
        (self.folder / f"video{number}.jpg").write_bytes(frame)

    def flag(self, name: str, number: int = 0) -> Path:
        """The file that makes a device ``unplugged`` or ``stalled`` while it exists."""
        return self.folder / f"video{number}.{name}"

    def log(self, number: int = 0) -> list[str]:
        """What was done to a device."""
        return (self.folder / f"video{number}.log").read_text().splitlines()

    def environment(self) -> dict[str, str]:
        """Environment of a program that sees the devices."""
        return {**os.environ, "LD_PRELOAD": str(self._library), "EMULATED_V4L2": str(self.folder)}

    def run(self, body: str) -> dict[str, Any]:
        """Runs lines of Python that fill the dictionary ``answer``, in a process that sees the devices."""
        program = _PROGRAM.format(body=textwrap.dedent(body))
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=self.environment(),
            capture_output=True,
            text=True,
            timeout=100,
        )
        assert done.returncode == 0, done.stderr
        lines = [line for line in done.stdout.splitlines() if line.startswith("ANSWER ")]
        answer: dict[str, Any] = json.loads(lines[-1].removeprefix("ANSWER "))
        return answer
