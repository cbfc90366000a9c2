"""Fixtures of an emulated servo bus and a driver on it; ``kind`` of a folder of tests names the family."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_servo.arm import ServoArm
from joshua_servo.bus import ServoBus
from patience import PATIENT_S, patient
from servo_families import Kind

OpenBus = Callable[..., AbstractContextManager[ServoBus]]
MakeArm = Callable[..., ServoArm]


@pytest.fixture
def emulator(kind: Kind) -> Iterator[EmulatedBus]:
    """Three servos without stops."""
    with kind.emulated_bus() as emulator:
        yield emulator


@pytest.fixture
def arm_emulator(kind: Kind) -> Iterator[EmulatedBus]:
    """A calibrated arm."""
    with kind.emulated_arm() as emulator:
        yield emulator


@pytest.fixture
def open_bus(kind: Kind) -> OpenBus:
    """Opens a bus on an emulator: ``with open_bus(emulator) as bus``; patient unless it is told otherwise."""

    @contextmanager
    def opened(emulator: EmulatedBus, **options: Any) -> Iterator[ServoBus]:
        with kind.open_bus(emulator, **options) as bus:
            if "reply_margin_s" not in options:
                bus.reply_margin_s = PATIENT_S
            yield bus

    return opened


@pytest.fixture
def make_arm(kind: Kind) -> Iterator[MakeArm]:
    """Makes patient drivers of emulated arms; closes them in the end."""
    arms: list[ServoArm] = []

    def make(emulator: EmulatedBus, facts: dict[str, Any] | None = None, **settings: Any) -> ServoArm:
        arm = kind.driver(emulator, facts, **settings)
        patient(arm.bus)
        arms.append(arm)
        return arm

    yield make
    for arm in arms:
        arm.disconnect()
