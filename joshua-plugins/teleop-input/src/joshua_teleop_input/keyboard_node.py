"""The node of the keyboard."""

from __future__ import annotations

import time

from joshua.api import DeviceDisconnected, NodeContext
from joshua.api.nodes import MessagePublisher
from joshua.messages import message_class
from joshua.messages.make import header
from joshua.tools import load_target

from joshua_teleop_input.gate import Gate
from joshua_teleop_input.help_text import keyboard_help
from joshua_teleop_input.input_node import JOY, InputNode
from joshua_teleop_input.key_decoder import KeyDecoder, KeyEvent, Kind
from joshua_teleop_input.key_terminal import KeyTerminal
from joshua_teleop_input.key_tracker import KeyTracker
from joshua_teleop_input.keys import HELP_KEY, canonical_key
from joshua_teleop_input.settings import ControlSettings, KeyboardSettings

#: Longest wait for a key; bounds the delay of releases by time.
READ_TIMEOUT_S = 0.02

#: An escape character that nothing follows within this time is the Escape key.
ESCAPE_TIMEOUT_S = 0.05

#: A key that repeats within this time may be held, because auto-repeat starts only after a delay.
REPETITION_BEGINS_S = 0.75


class KeyboardNode(InputNode):
    """Drives joints with the keys of the terminal that started the run."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings: KeyboardSettings | None = None
        self._terminal = KeyTerminal()
        self._decoder = KeyDecoder()
        self._tracker = KeyTracker(0.0)
        self._names: dict[str, str] = {}
        self._switch_seen_s = float("-inf")
        self._switch_blocked = False
        self._reader_runs = False

    @property
    def settings(self) -> KeyboardSettings:
        """Settings of the node."""
        assert self._settings is not None
        return self._settings

    def configure(self) -> None:
        """Open the terminal and declare topics. Raises InputDeviceError."""
        spec = self.context.spec
        settings = self._settings = load_target(spec.settings_type).model_validate(spec.settings)
        self._tracker = KeyTracker(settings.key_hold_s)
        self._names = {name: str(canonical_key(name)) for name in _names(settings)}
        self.set_up(settings, Gate("", settings.enable_key), lambda value: value, settings.release_key)
        self._terminal.open()

    def activate(self) -> None:
        """Start the reader and log the mapping of keys."""
        if self._reader_runs:
            return
        self._reader_runs = True
        self._show_help()
        self.context.spawn_thread(self._read, name="keyboard")

    def deactivate(self) -> None:
        """Stop all motion."""
        if self._drive is not None:
            self.release()

    def cleanup(self) -> None:
        """Restore the terminal."""
        self._terminal.close()

    def publish_joy(self, publisher: MessagePublisher) -> None:
        """Return one axis for each control and a button for each key; enable and release keys come last."""
        held = self._tracker.held(time.monotonic())
        axes = [self._value(control, held) for control in self.settings.controls]
        buttons = [int(key in held) for key in self._names.values()]
        frame_id = self.context.spec.frame_id
        message = message_class(JOY)(header(frame_id, self.context.now_ns()), axes, buttons)
        publisher.publish(message)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the test rows: whether the terminal stayed connected, and how it reports keys."""
        what = "reports releases" if self._tracker.reports_releases else "keys count as held by time"
        return [("terminal", True, what), *super().test_results()]

    def _read(self) -> None:
        waits_since_s = time.monotonic()
        while not self.context.stopping:
            self.reads()
            try:
                data = self._terminal.read(READ_TIMEOUT_S)
            except DeviceDisconnected as error:
                self.release()
                self.context.fail(str(error))
                return
            now_s = time.monotonic()
            events = self._decoder.feed(data)
            if data:
                waits_since_s = now_s
            elif self._decoder.waiting and now_s - waits_since_s > ESCAPE_TIMEOUT_S:
                events += self._decoder.flush()
            for event in events:
                self._take_event(event, now_s)
            self._pass_on(now_s)

    def _take_event(self, event: KeyEvent, now_s: float) -> None:
        if event.kind is Kind.INTERRUPT:
            self.release()
            self._terminal.interrupt()
        elif event.kind is Kind.REPORTS_RELEASES:
            if not self._tracker.reports_releases:
                self._terminal.report_releases()
                self._tracker.reports_releases = True
                self.context.log.debug("the terminal reports when a key is released")
        elif event.key == HELP_KEY:
            if event.kind is Kind.PRESS:
                self._show_help()
        else:
            self._guard_switch(event, now_s)
            self._tracker.take(event, now_s)
            self._pass_on(now_s)

    def _guard_switch(self, event: KeyEvent, now_s: float) -> None:
        """Make a held enable key switch off at once, and never on again by auto-repeat."""
        if not self.settings.enable_key or event.key != canonical_key(self.settings.enable_key):
            return
        if not self._tracker.reports_releases:
            held_perhaps = now_s - self._switch_seen_s < REPETITION_BEGINS_S
            self._switch_blocked = held_perhaps and not self.drive.gate.enabled
        self._switch_seen_s = now_s

    def _pass_on(self, now_s: float) -> None:
        held = self._tracker.held(now_s)

        def value(name: str) -> float:
            if name == self.settings.enable_key and self._switch_blocked:
                return 0.0
            return float(self._names[name] in held)

        self.take(value)

    def _value(self, control: ControlSettings, held: frozenset[str]) -> float:
        negative = self._names.get(control.negative)
        return float(self._names[control.positive] in held) - float(negative in held)

    def _show_help(self) -> None:
        for line in keyboard_help(self.settings):
            self.context.log.info("%s", line)


def _names(settings: KeyboardSettings) -> list[str]:
    """Return the names of all keys, in the order of the file."""
    names = [name for control in settings.controls for name in (control.positive, control.negative) if name]
    return [*names, *(name for name in (settings.enable_key, settings.release_key) if name)]
