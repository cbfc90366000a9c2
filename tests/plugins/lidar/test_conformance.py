"""The scanner keeps the contract of sensors: one that is asked, and one that sends by itself."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from joshua.devices.sensor import Sensor
from joshua.testing import check_sensor
from joshua_emulator import EmulatedLidar
from joshua_lidar.lidar import SerialLidar
from lidar_settings import make_settings


@pytest.mark.parametrize("model", ["rplidar_c1", "ld19"])
def test_the_contract_of_sensors(emulator_of: Callable[..., EmulatedLidar], model: str) -> None:
    emulator = emulator_of(model)
    settings = make_settings(emulator.port, model)
    emulator.ask("state")  # opens the control channel, which is not the scanner's

    def unplug(_: Sensor) -> None:
        emulator.fault("unplug")

    check_sensor(lambda: SerialLidar(settings), unplug=unplug, timeout_s=30)
