from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from joshua.schema import config_pb2
from joshua_camera.camera import OpenCvCamera
from joshua_camera.settings import CameraSettings
from joshua_emulator import EmulatedCamera

WIDTH, HEIGHT, FPS = 320, 240, 60


def make_settings(publishes: tuple[str, ...] = (), **fields: Any) -> CameraSettings:
    """Settings as the plan makes them from a block."""
    block = config_pb2.CameraConfig(**{"width": WIDTH, "height": HEIGHT, "fps": FPS, **fields})
    return CameraSettings.from_block(block).model_copy(update={"publishes": publishes})


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
