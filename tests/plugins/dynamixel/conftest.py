"""An emulated Koch arm and a driver on it: everything between them is bytes on a pseudo-terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.bus import Bus
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from patience import PATIENT_S, patient

OpenBus = Callable[..., Any]
MakeArm = Callable[..., DynamixelActuator]


@contextmanager
def _open_bus(emulator: EmulatedBus, baudrate: int = 1_000_000, **options: Any) -> Iterator[Bus]:
    port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), baudrate)
    port.open()
    try:
        bus = Bus(port, **options)
        bus.detect_echo()
        if "reply_margin_s" not in options:
            bus.reply_margin_s = PATIENT_S
        yield bus
    finally:
        port.close()


@pytest.fixture
def open_bus() -> OpenBus:
    """Opens a bus on an emulator: ``with open_bus(emulator) as bus``; patient unless it is told otherwise."""
    return _open_bus


@pytest.fixture
def emulator() -> Iterator[EmulatedBus]:
    """Three servos without stops, in position mode, of two models."""
    with EmulatedBus("dynamixel", ids=(1, 2, 3), models=("xl330-m077", "xl430-w250")) as emulator:
        yield emulator


@pytest.fixture
def arm_emulator() -> Iterator[EmulatedBus]:
    """A calibrated Koch arm, in extended position mode."""
    with EmulatedBus("dynamixel", arm="koch", calibrated=True, identity="KOCH1") as emulator:
        yield emulator


@pytest.fixture
def make_arm() -> Iterator[MakeArm]:
    """Makes patient drivers of emulated arms; closes them in the end."""
    arms: list[DynamixelActuator] = []

    def make(
        emulator: EmulatedBus,
        context: dict[str, Any] | None = None,
        *,
        calibrated: bool = True,
        **settings: Any,
    ) -> DynamixelActuator:
        values = {
            "port": emulator.port,
            "device_root": str(emulator.root),
            "motor_ids": [servo["id"] for servo in emulator.servos()],
            "models": ["xl330-m077"],
            "calibration": emulator.calibration() if calibrated else None,
            **settings,
        }
        arm = DynamixelActuator(DynamixelSettings.model_validate(values), context)
        patient(arm.bus)
        arms.append(arm)
        return arm

    yield make
    for arm in arms:
        arm.disconnect()
