from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from gamepads import node_spec, wait_until_reported
from joshua.testing.recording_context import RecordingContext
from joshua_emulator import EmulatedGamepad
from joshua_teleop_input.gamepad_node import GamepadNode
from joshua_teleop_input.settings import GamepadSettings

Started = tuple[GamepadNode, RecordingContext]


@pytest.fixture(scope="module")
def emulator_process() -> Iterator[EmulatedGamepad]:
    with EmulatedGamepad() as process:
        yield process


@pytest.fixture
def pad(emulator_process: EmulatedGamepad) -> Iterator[EmulatedGamepad]:
    """An emulated gamepad without faults that nobody touches."""
    yield emulator_process
    emulator_process.ask("clear_faults")
    emulator_process.ask("motion", kind="")
    wait_until_reported(emulator_process)


@pytest.fixture
def start() -> Iterator[Callable[..., Started]]:
    """Starts nodes that are stopped at the end: ``start(settings, joy=True)``."""
    started: list[Started] = []

    def begin(settings: GamepadSettings, *, joy: bool = False) -> Started:
        context: Any = RecordingContext(node_spec(settings, joy=joy))
        node = GamepadNode(context)
        started.append((node, context))
        node.configure()
        node.activate()
        return node, context

    yield begin
    for node, context in started:
        context._stop.set()
        node.deactivate()
        context.stop()
        node.cleanup()
