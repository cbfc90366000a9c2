"""Fixtures for tests with mock devices and their clock."""

from __future__ import annotations

from typing import Any

import pytest
from joshua.schema import config_pb2
from joshua_mock.actuator import MockActuator
from joshua_mock.settings import MockMotorSettings
from stepped_time import SteppedTime

#: Modules by whose clock mock devices and their nodes work.
CLOCKED = (
    "joshua.devices.actuator_node",
    "joshua.devices.command_intake",
    "joshua_mock.sensors",
    "joshua.devices.stamps",
    "joshua_mock.actuator",
)


@pytest.fixture
def stepped_time(monkeypatch: pytest.MonkeyPatch) -> SteppedTime:
    """The clock of the mock devices and their nodes, in the hands of the test."""
    clock = SteppedTime()
    for name in CLOCKED:
        monkeypatch.setattr(f"{name}.time", clock)
    return clock


@pytest.fixture
def mock_arm() -> Any:
    """Makes mock actuators: ``mock_arm(num_motors=3, position_max=…)``."""

    def make(**fields: Any) -> MockActuator:
        block = config_pb2.MockMotorConfig(**{"num_motors": 3, "position_max": 4095, **fields})
        return MockActuator(MockMotorSettings.from_block(block))

    return make
