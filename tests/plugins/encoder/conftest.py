from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from encoder_settings import make_settings
from joshua_emulator import EmulatedEncoder
from joshua_encoder.encoder import SerialEncoder


@pytest.fixture
def emulator_of() -> Iterator[Callable[..., EmulatedEncoder]]:
    """Starts emulated encoders that end with the test: ``emulator_of("amt21", baudrate=2_000_000)``."""
    started: list[EmulatedEncoder] = []

    def start(kind: str = "line", **options: Any) -> EmulatedEncoder:
        process = EmulatedEncoder(kind, **options)
        started.append(process)
        process.start()
        return process

    yield start
    for process in started:
        process.close()


@pytest.fixture
def encoder_at() -> Iterator[Callable[..., SerialEncoder]]:
    """Makes encoders that are closed at the end: ``encoder_at(port, "as5600", inverted=True)``."""
    made: list[SerialEncoder] = []

    def make(port: str, protocol: str = "", baudrate: int = 115_200, **fields: Any) -> SerialEncoder:
        encoder = SerialEncoder(make_settings(port, protocol, baudrate, **fields))
        made.append(encoder)
        return encoder

    yield make
    for encoder in made:
        encoder.disconnect()
