"""The conformance check that any actuator must pass, on an emulated hub."""

from __future__ import annotations

from collections.abc import Callable

from joshua.devices.actuator import Actuator
from joshua.testing import check_actuator
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike.actuator import SpikeActuator


def test_the_driver_keeps_the_contract_of_actuators(
    hub: EmulatedHub, make_actuator: Callable[..., SpikeActuator]
) -> None:
    def unplug(device: Actuator) -> None:
        hub.fault("unplug")

    hub.state()  # opens the channel through which the test itself speaks to the emulator
    check_actuator(make_actuator, unplug=unplug, timeout_s=30.0)
