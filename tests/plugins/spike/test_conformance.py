"""The conformance checks that any actuator and calibration target must pass, on an emulated hub."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_calibration.target import CalibrationTarget
from joshua_calibration.testing import check_calibration_target
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike import link
from joshua_spike.actuator import SpikeActuator
from joshua_spike.link import FIND_TIMEOUT_S


@pytest.fixture(autouse=True)
def search(patience: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as in use: the kit has a second driver search for a hub that the first one holds."""
    monkeypatch.setattr(link, "FIND_TIMEOUT_S", FIND_TIMEOUT_S)


def test_the_driver_keeps_the_contract_of_actuators(
    hub: EmulatedHub, make_actuator: Callable[..., SpikeActuator]
) -> None:
    def unplug(device: Actuator) -> None:
        hub.fault("unplug")

    hub.state()  # opens the channel through which the test itself speaks to the emulator
    check_actuator(make_actuator, unplug=unplug, timeout_s=30.0)


def test_its_target_keeps_the_contract_of_calibration_targets(
    hub: EmulatedHub, make_actuator: Callable[..., SpikeActuator]
) -> None:
    def make() -> CalibrationTarget:
        return make_actuator().calibration_target()

    def hand(joint: int | None, seconds: float) -> bool:
        hub.guide(joint, seconds)
        return True

    hub.state()
    check_calibration_target(make, hand=hand, unplug=lambda target: hub.fault("unplug"), timeout_s=30.0)
