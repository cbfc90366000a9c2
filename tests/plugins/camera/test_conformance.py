"""The camera keeps the contract of sensors, on a stream, on files and on a device."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from camera_settings import make_settings
from joshua.devices.sensor import Sensor
from joshua.testing import check_sensor
from joshua_camera.camera import OpenCvCamera
from joshua_emulator import EmulatedCamera


def test_on_a_stream(emulator: EmulatedCamera) -> None:
    settings = make_settings(source=emulator.source)

    emulator.ask("state")  # opens the control channel, which is not the camera's

    def unplug(_: Sensor) -> None:
        emulator.fault("unplug")

    check_sensor(lambda: OpenCvCamera(settings), unplug=unplug, timeout_s=30)


def test_on_numbered_pictures(tmp_path: Path) -> None:
    for number in range(5):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), np.full((240, 320, 3), 40 * number, np.uint8))
    settings = make_settings(source=str(tmp_path / "%04d.png"))
    check_sensor(lambda: OpenCvCamera(settings), timeout_s=30)
