"""What the tests of the driver share: an emulated hub, and settings that reach it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from joshua.devices.context import ActuatorContext
from joshua.plan import ActuatorFacts
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike import client, link, session
from joshua_spike.actuator import SpikeActuator
from joshua_spike.settings import SpikeSettings

HUB_NAME = "Pybricks Hub"


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets nothing be given up because this machine holds somebody up; tests of a limit bring it back."""
    monkeypatch.setattr(client, "DEAD_MAN_S", 30.0)
    monkeypatch.setattr(client, "STATE_TIMEOUT_S", 30.0)
    monkeypatch.setattr(client, "ORDER_TIMEOUT_S", 30.0)
    monkeypatch.setattr(session, "ORDER_PATIENCE_S", 30.0)
    monkeypatch.setattr(session, "CONFIGURE_PATIENCE_S", 30.0)
    monkeypatch.setattr(session, "HELLO_PATIENCE_S", 30.0)
    monkeypatch.setattr(session, "READY_TIMEOUT_S", 30.0)
    monkeypatch.setattr(link, "FIND_TIMEOUT_S", 30.0)
    monkeypatch.setattr(link, "COMMAND_TIMEOUT_S", 30.0)


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> Iterator[EmulatedHub]:
    """A hub with motors on A and B."""
    monkeypatch.setattr("joshua_spike.bumble_backend.OPEN_TIMEOUT_S", 30.0)
    with EmulatedHub(("A", "B"), name=HUB_NAME) as emulated:
        yield emulated


@pytest.fixture
def make_actuator(hub: EmulatedHub) -> Iterator[Callable[..., SpikeActuator]]:
    """Makes drivers of the emulated hub; they are closed after the test."""
    made: list[SpikeActuator] = []

    def make(facts: dict[str, Any] | None = None, **values: Any) -> SpikeActuator:
        settings = {"device_name": HUB_NAME, "adapter": hub.adapter, "port_names": ["A", "B"], **values}
        actuator = SpikeActuator(
            SpikeSettings.model_validate(settings),
            ActuatorContext(ActuatorFacts(**({"allow_uncalibrated": True} if facts is None else facts))),
        )
        made.append(actuator)
        return actuator

    yield make
    for actuator in made:
        actuator.disconnect()
