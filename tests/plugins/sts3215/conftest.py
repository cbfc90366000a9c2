"""What only this family of servos does; tests/plugins/servo holds what all of them do."""

from __future__ import annotations

import pytest
from servo_families import STS3215_KIND, Kind
from servo_fixtures import arm_emulator as arm_emulator
from servo_fixtures import emulator as emulator
from servo_fixtures import make_arm as make_arm
from servo_fixtures import open_bus as open_bus


@pytest.fixture
def kind() -> Kind:
    """The family of this folder."""
    return STS3215_KIND
