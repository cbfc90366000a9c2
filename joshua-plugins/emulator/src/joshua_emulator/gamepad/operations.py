"""Operations of the control channel for an emulated gamepad."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, ClassVar

from joshua_emulator.control import ControlError
from joshua_emulator.fault_rules import LASTS, PLAIN, RETURNS, FaultRule, Number
from joshua_emulator.gamepad.hand import MOTIONS
from joshua_emulator.gamepad.server import GamepadServer
from joshua_emulator.gamepad.xbox import AXES, BUTTONS, NAMES, TRIGGERS
from joshua_emulator.operations import Action, DeviceOperations, Request

MAX_RATE_HZ = 1000.0

FAULTS: dict[str, FaultRule] = {
    "stall": LASTS,
    "unplug": RETURNS,
    "replug": PLAIN,
    "rate": FaultRule(Number(f"above 0, at most {MAX_RATE_HZ:g} Hz", 0, MAX_RATE_HZ, above=True)),
    "dirty": PLAIN,
    "drop": PLAIN,
}


class GamepadOperations(DeviceOperations):
    """Operations by name. ``handle`` is the control channel's handler."""

    refusals: ClassVar[tuple[type[Exception], ...]] = (OSError,)

    def __init__(self, server: GamepadServer) -> None:
        super().__init__(server.log, FAULTS)
        self._server = server
        self._rate_hz = server.rate_hz
        self.operations = {
            "state": self._state,
            "set": self._set,
            "motion": self._motion,
            "log": self.read_log,
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: server.stop(),
        }

    def at(self, delay_s: float, action: Action) -> None:
        """Call ``action`` after a delay, on the loop of the gamepad."""
        self._server.timers.at(delay_s, action)

    def _state(self, _: Request) -> dict[str, Any]:
        server = self._server
        return {
            "t_ns": time.monotonic_ns(),
            "plugged": server.plugged,
            "stalled": server.stalled,
            "rate_hz": server.rate_hz,
            "clients": server.clients,
            "reports": server.reports,
            "axes": dict(server.axes),
            "held": sorted(server.held),
            "reported": server.reported,
        }

    def _set(self, request: Request) -> None:
        """Move axes and buttons by name; everything else stays."""
        for name, value in request["values"].items():
            if name not in NAMES:
                raise ControlError(f"unknown axis or button {name!r}; allowed: {', '.join(NAMES)}")
            number, least = float(value), 0 if name in TRIGGERS or name in BUTTONS else -1
            if not least <= number <= 1:
                raise ControlError(f"{name} is {number:g}; allowed: {least} to 1")
        for name, value in request["values"].items():
            if name in BUTTONS:
                self._server.press(name, down=float(value) > 0)
            else:
                self._server.axes[name] = float(value)

    def _motion(self, request: Request) -> None:
        """Let a hand move it, or end that with the kind ""."""
        kind = request["kind"]
        if kind and kind not in MOTIONS:
            raise ControlError(f"unknown motion {kind!r}; allowed: {', '.join(MOTIONS)}")
        self._server.motion = MOTIONS[kind] if kind else None
        if not kind:
            self._server.axes = dict.fromkeys(AXES, 0.0)
            self._server.held.clear()

    def fault_action(self, kind: str, request: Request) -> Action:
        """The action that injects a valid fault."""
        server = self._server
        makers: dict[str, Callable[[Request], Action]] = {
            "stall": self._stall,
            "unplug": self._unplug,
            "replug": lambda _: server.plug,
            "rate": self._rate,
            "dirty": lambda _: self._dirty,
            "drop": lambda _: server.drop_records,
        }
        return makers[kind](request)

    def _stall(self, request: Request) -> Action:
        """No record for ``value`` seconds, or until the faults are cleared; connections stay open."""

        def stall() -> None:
            self._server.stalled = True
            self.log.add("stall", time.monotonic())

        return self.lasting("stall", request, stall, self._go_on)

    def _go_on(self) -> None:
        if self._server.stalled:
            self._server.stalled = False
            self.log.add("go_on", time.monotonic())

    def _unplug(self, request: Request) -> Action:
        server = self._server
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            server.unplug()
            if replug_after_s > 0:
                self.later(replug_after_s, server.plug)

        return unplug

    def _rate(self, request: Request) -> Action:
        rate_hz = float(request["value"])
        return lambda: self._server.set_rate(rate_hz)

    def _dirty(self) -> None:
        """A hand already holds everything: sticks deflected, bumper and start pressed."""
        self._server.axes.update(left_x=1.0, left_y=-1.0, right_x=1.0, right_y=-1.0)
        self._server.held.update(("left_bumper", "start", "a"))

    def _clear_faults(self, _: Request) -> None:
        """End all faults: it is plugged in, continues, and has its first rate."""
        server = self._server
        self.end_lasting()
        self._go_on()
        server.plug()
        if server.rate_hz != self._rate_hz:
            server.set_rate(self._rate_hz)
