"""Encoders keep the contract of sensors: ones that send by themselves, and ones that are asked."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from encoder_settings import make_settings
from joshua.devices.sensor import Sensor
from joshua.testing import check_sensor
from joshua_emulator import EmulatedEncoder
from joshua_encoder.encoder import SerialEncoder


@pytest.mark.parametrize(("kind", "baudrate"), [("line", 115_200), ("as5600", 115_200), ("amt21", 2_000_000)])
def test_the_contract_of_sensors(
    emulator_of: Callable[..., EmulatedEncoder], kind: str, baudrate: int
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate)
    settings = make_settings(emulator.port, kind, baudrate)
    emulator.ask("state")  # opens the control channel, which is not the encoder's

    def unplug(_: Sensor) -> None:
        emulator.fault("unplug")

    check_sensor(lambda: SerialEncoder(settings), unplug=unplug, timeout_s=30)
