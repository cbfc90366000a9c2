from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from camera_settings import FPS, HEIGHT, WIDTH, make_settings
from joshua_camera.camera import OpenCvCamera
from joshua_emulator import EmulatedCamera


@pytest.fixture(scope="module")
def emulator_process() -> Iterator[EmulatedCamera]:
    with EmulatedCamera(WIDTH, HEIGHT, FPS) as process:
        yield process


@pytest.fixture
def emulator(emulator_process: EmulatedCamera) -> Iterator[EmulatedCamera]:
    """An emulated camera without faults."""
    yield emulator_process
    emulator_process.ask("clear_faults")


@pytest.fixture
def camera_at() -> Iterator[Callable[..., OpenCvCamera]]:
    """Makes cameras that are closed at the end: ``camera_at(source, fps=…)``."""
    made: list[OpenCvCamera] = []

    def make(source: str = "", publishes: tuple[str, ...] = (), **fields: Any) -> OpenCvCamera:
        camera = OpenCvCamera(make_settings(publishes, source=source, **fields))
        made.append(camera)
        return camera

    yield make
    for camera in made:
        camera.disconnect()
