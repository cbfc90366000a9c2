"""A gamepad, local or shared, read through the kernel's input records."""

from __future__ import annotations

import time

from joshua_teleop_input.codes import EV_SYN, SYN_DROPPED, SYN_REPORT
from joshua_teleop_input.discovery import EventDevice
from joshua_teleop_input.events import Capabilities
from joshua_teleop_input.layout import Source, mapped_source, present, standard_layout
from joshua_teleop_input.pad_state import PadState, StateTracker
from joshua_teleop_input.settings import GamepadSettings


class EventPad:
    """An open gamepad; its first state is that at opening.

    Args:
        device: already open; ``close`` closes it.
        settings: with the mapping of this gamepad.
    """

    def __init__(self, device: EventDevice, settings: GamepadSettings) -> None:
        self._device = device
        layout = present(layout_for(device.capabilities, settings), device.capabilities)
        self.name = f"{device.capabilities.name} ({device.path})"
        self.names = frozenset(layout)
        self._tracker = StateTracker(device.capabilities, layout)
        self._heard_s = time.monotonic()
        self._live = True
        self._lost_records = False
        self._changed = False
        self._first: list[PadState] = [self._tracker.state()]

    def read(self, timeout_s: float) -> list[PadState]:
        """Wait for new states; a missing heartbeat of the sender also yields one."""
        if self._first:
            states, self._first = self._first, []
            return states
        limit_s = self._device.silence_limit_s
        if limit_s is not None and self._live:
            timeout_s = min(timeout_s, max(0.0, self._heard_s + limit_s - time.monotonic()))
        events = self._device.read(timeout_s)
        now_s = time.monotonic()
        if not events:
            if limit_s is not None and self._live and now_s - self._heard_s >= limit_s:
                self._live = False
                return [PadState(live=False)]
            return []
        self._heard_s = now_s
        states = []
        for event in events:
            if event.type != EV_SYN:
                if not self._lost_records:
                    self._tracker.take(event)
                    self._changed = True
            elif event.code == SYN_DROPPED:
                self._lost_records = True
            elif event.code == SYN_REPORT:
                states += self._report()
        return states

    def close(self) -> None:
        """Close the device. Idempotent."""
        self._device.close()

    def _report(self) -> list[PadState]:
        """Yield the states that a report of the device completes."""
        states = []
        if self._lost_records:
            # What was pressed in the meantime is unknown: first treat all controls as released.
            self._lost_records = False
            states.append(PadState(live=False))
            self._tracker.begin(self._device.resynchronise())
            self._changed = True
        if self._changed or not self._live:
            self._live, self._changed = True, False
            states.append(self._tracker.state())
        return states


def layout_for(device: Capabilities, settings: GamepadSettings) -> dict[str, Source]:
    """Return the layout of a device; the file's mapping takes precedence."""
    layout = standard_layout(device)
    for entry in settings.mapping:
        layout[entry.name] = mapped_source(entry.name, entry.source, entry.inverted)
    return layout
