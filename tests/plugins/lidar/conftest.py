from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from joshua_emulator import EmulatedLidar
from joshua_lidar.lidar import SerialLidar
from lidar_settings import make_settings


@pytest.fixture
def emulator_of() -> Iterator[Callable[..., EmulatedLidar]]:
    """Starts emulated scanners that end with the test: ``emulator_of("ld19")``."""
    started: list[EmulatedLidar] = []

    def start(model: str = "rplidar_a1", **options: Any) -> EmulatedLidar:
        process = EmulatedLidar(model, **options)
        started.append(process)
        process.start()
        return process

    yield start
    for process in started:
        process.close()


@pytest.fixture
def lidar_at() -> Iterator[Callable[..., SerialLidar]]:
    """Makes scanners that are closed at the end: ``lidar_at(port, "ld19", angle_min=…)``."""
    made: list[SerialLidar] = []

    def make(port: str, model: str = "", baudrate: int = 0, **fields: Any) -> SerialLidar:
        lidar = SerialLidar(make_settings(port, model, baudrate, **fields))
        made.append(lidar)
        return lidar

    yield make
    for lidar in made:
        lidar.disconnect()
