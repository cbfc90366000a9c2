"""Each test of this folder holds for every family of servo buses."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from joshua_emulator import EmulatedBus
from servo_families import KINDS, Kind


@pytest.fixture(params=KINDS, ids=lambda kind: kind.protocol)
def kind(request: pytest.FixtureRequest) -> Kind:
    """A family of servos."""
    found: Kind = request.param
    return found


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
