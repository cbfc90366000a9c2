"""Each test of this folder holds for every family of servo buses."""

from __future__ import annotations

import pytest
from servo_families import KINDS, Kind
from servo_fixtures import arm_emulator as arm_emulator
from servo_fixtures import emulator as emulator
from servo_fixtures import make_arm as make_arm
from servo_fixtures import open_bus as open_bus


@pytest.fixture(params=KINDS, ids=lambda kind: kind.protocol)
def kind(request: pytest.FixtureRequest) -> Kind:
    """A family of servos."""
    found: Kind = request.param
    return found
