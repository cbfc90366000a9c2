"""The node of a gamepad."""

from __future__ import annotations

import time

from joshua.api import DeviceDisconnected, DeviceError, NodeContext, Reading, SensorContext
from joshua.api.nodes import MessagePublisher, SensorFacts, load_implementation

from joshua_teleop_input.gamepad import JOY, Gamepad
from joshua_teleop_input.gate import Gate
from joshua_teleop_input.help_text import gamepad_help
from joshua_teleop_input.input_node import InputNode
from joshua_teleop_input.pad_state import PadState
from joshua_teleop_input.settings import GamepadSettings
from joshua_teleop_input.shaping import with_expo, without_dead_zone

#: Longest wait for a state; bounds the delay of a stop request.
READ_TIMEOUT_S = 0.1

#: Share of its range from which a control counts as moved in MODE_TEST.
MOVED_FROM = 0.5

RECONNECT_FIRST_S = 0.25
RECONNECT_LARGEST_S = 5.0


class GamepadNode(InputNode):
    """Publishes a gamepad's state and drives joints with it.

    When the gamepad is disconnected, all motion stops. The node reopens it as soon as it returns; driving
    must then be switched on again.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._gamepad: Gamepad | None = None
        self._reading: Reading | None = None
        self._readings = 0
        self._losses = 0
        self._moved: set[str] = set()
        self._reader_runs = False

    @property
    def gamepad(self) -> Gamepad:
        """Return the device."""
        assert self._gamepad is not None
        return self._gamepad

    def configure(self) -> None:
        """Open the device and declare topics. Raises DeviceError, TargetError."""
        implementation, settings = load_implementation(self.context.spec, Gamepad)
        assert isinstance(settings, GamepadSettings)
        self._gamepad = implementation(settings, SensorContext(self.context.spec.facts_as(SensorFacts)))

        def shape(value: float) -> float:
            return with_expo(without_dead_zone(value, settings.dead_zone), settings.expo)

        gate = Gate(settings.dead_man_button, settings.enable_button)
        self.set_up(settings, gate, shape, settings.release_button)
        self.gamepad.connect()
        if self.gamepad.note:
            self.context.warn(self.gamepad.note)

    def activate(self) -> None:
        """Start the reader and log the mapping of controls."""
        if self._reader_runs:
            return
        self._reader_runs = True
        self.context.log.info("reads %s", self.gamepad.name)
        for line in gamepad_help(self.gamepad.settings):
            self.context.log.info("%s", line)
        self.context.spawn_thread(self._read, name="gamepad")

    def deactivate(self) -> None:
        """Stop all motion."""
        if self._drive is not None:
            self.release()

    def cleanup(self) -> None:
        """Close the device."""
        if self._gamepad is not None:
            self._gamepad.disconnect()

    def publish_joy(self, publisher: MessagePublisher) -> None:
        """Publish the newest state; nothing while the device is disconnected."""
        reading = self._reading
        if reading is None:
            return
        now = Reading(self.context.now_ns(), reading.sequence, reading.data)
        publisher.publish(self.gamepad.message(now, JOY, self.context.spec.frame_id))

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the test rows: whether the device stayed connected, and which controls were used."""
        lost = f", lost {self._losses} times" if self._losses else ""
        row = ("gamepad", self._readings > 0 and not self._losses, f"{self.gamepad.name}{lost}")
        tried = (
            "moved in the test",
            True,
            ", ".join(sorted(self._moved)) or "none: press the buttons and move the sticks that you use",
        )
        return [row, tried, *super().test_results()]

    def _read(self) -> None:
        while not self.context.stopping:
            self.reads()
            try:
                reading = self.gamepad.read(READ_TIMEOUT_S)
            except DeviceDisconnected as error:
                self._lose(error)
                self._reconnect()
                continue
            if reading is not None:
                self._take(reading)

    def _take(self, reading: Reading) -> None:
        state: PadState = reading.data
        self._reading = reading
        self._readings += 1
        self._moved.update(name for name, value in state.values.items() if abs(value) >= MOVED_FROM)
        if state.live:
            self.take(state.value)
            return
        if self.release():
            self.context.log.warning("the gamepad sends no data: all controls count as released")

    def _lose(self, error: DeviceDisconnected) -> None:
        """Stop all motion, publish the released state as a last Joy, and publish no further ones."""
        self.release()
        self._losses += 1
        if self._reading is not None:
            self._reading = Reading(self.context.now_ns(), self._reading.sequence, PadState(live=False))
            for publisher in self._joys:
                self.publish_joy(publisher)
        self._reading = None
        self.context.log.warning("gamepad disconnected; the arm holds: %s; searching until it is back", error)

    def _reconnect(self) -> None:
        wait_s = RECONNECT_FIRST_S
        said = ""
        while not self.context.stopping:
            self.reads("gamepad disconnected")
            self.gamepad.disconnect()
            if self._stopped_within(wait_s):
                return
            try:
                self.gamepad.connect()
            except DeviceError as error:
                wait_s = min(2 * wait_s, RECONNECT_LARGEST_S)
                level = self.context.log.debug if str(error) == said else self.context.log.warning
                level("gamepad still disconnected: %s", error)
                said = str(error)
            else:
                self.context.log.info("gamepad reconnected: %s; switch driving on again", self.gamepad.name)
                return

    def _stopped_within(self, duration_s: float) -> bool:
        end_s = time.monotonic() + duration_s
        while not (stopped := self.context.stopping) and (left_s := end_s - time.monotonic()) > 0:
            time.sleep(min(left_s, 0.05))
        return stopped
