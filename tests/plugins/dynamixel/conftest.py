"""What only this family of servos does; tests/plugins/servo holds what all of them do."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from joshua_emulator import EmulatedBus
from servo_families import DYNAMIXEL_KIND, Kind
from servo_fixtures import arm_emulator as arm_emulator
from servo_fixtures import make_arm as make_arm
from servo_fixtures import open_bus as open_bus


@pytest.fixture
def kind() -> Kind:
    """The family of this folder."""
    return DYNAMIXEL_KIND


@pytest.fixture
def emulator() -> Iterator[EmulatedBus]:
    """Three servos without stops, in position mode, of two models."""
    with DYNAMIXEL_KIND.emulated_bus(models=("xl330-m077", "xl430-w250")) as emulator:
        yield emulator
