"""What the control channel can ask of an emulated gamepad."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from joshua_emulator.control import ControlError
from joshua_emulator.fault_rules import LASTS, PLAIN, RETURNS, FaultRule, Number, check_fault
from joshua_emulator.gamepad.hand import MOTIONS
from joshua_emulator.gamepad.server import GamepadServer
from joshua_emulator.gamepad.xbox import AXES, BUTTONS, NAMES

Request = dict[str, Any]

MAX_RATE_HZ = 1000.0

FAULTS: dict[str, FaultRule] = {
    "stall": LASTS,
    "unplug": RETURNS,
    "replug": PLAIN,
    "rate": FaultRule(Number(f"above 0, at most {MAX_RATE_HZ:g} Hz", 0, MAX_RATE_HZ, above=True)),
    "dirty": PLAIN,
    "drop": PLAIN,
}


class GamepadOperations:
    """Operations by name; ``handle`` is the control channel's handler."""

    def __init__(self, server: GamepadServer) -> None:
        self._server = server
        self._rate_hz = server.rate_hz
        self._stalls = 0
        self._operations: dict[str, Callable[[Request], dict[str, Any] | None]] = {
            "state": self._state,
            "set": self._set,
            "motion": self._motion,
            "log": self._read_log,
            "fault": self._fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: server.stop(),
        }

    def handle(self, request: Request) -> dict[str, Any]:
        """Carries out one request. Raises ControlError."""
        operation = self._operations.get(request["op"])
        if operation is None:
            raise ControlError(f"unknown operation {request['op']!r}; allowed: {', '.join(self._operations)}")
        try:
            return operation(request) or {}
        except KeyError as error:
            raise ControlError(f"{request['op']}: {error.args[0]!r} is missing") from error
        except (TypeError, ValueError) as error:
            raise ControlError(f"{request['op']}: a value is wrong ({error})") from error

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
        }

    def _set(self, request: Request) -> None:
        """Moves axes and buttons by name; everything else stays."""
        for name, value in request["values"].items():
            if name not in NAMES:
                raise ControlError(f"unknown axis or button {name!r}; allowed: {', '.join(NAMES)}")
            number = float(value)
            if not -1 <= number <= 1:
                raise ControlError(f"{name} is {number:g}; allowed: -1 to 1")
        for name, value in request["values"].items():
            if name in BUTTONS:
                self._server.press(name, down=float(value) > 0)
            else:
                self._server.axes[name] = float(value)

    def _motion(self, request: Request) -> None:
        """Lets a hand move it, or ends that with the kind ""."""
        kind = request["kind"]
        if kind and kind not in MOTIONS:
            raise ControlError(f"unknown motion {kind!r}; allowed: {', '.join(MOTIONS)}")
        self._server.motion = MOTIONS[kind] if kind else None
        if not kind:
            self._server.axes = dict.fromkeys(AXES, 0.0)
            self._server.held.clear()

    def _read_log(self, request: Request) -> dict[str, Any]:
        entries = self._server.log.since(
            int(request.get("since", 0)), request.get("events", ()), int(request.get("limit", 10_000))
        )
        return {"entries": entries}

    def _fault(self, request: Request) -> None:
        """Brings a fault about: ``kind``, its ``value`` and settings, ``at_s`` seconds from now on."""
        check_fault(request, FAULTS)
        action = self._fault_action(request["kind"], request)
        delay_s = float(request.get("at_s", 0.0))
        if delay_s > 0:
            self._server.at(delay_s, action)
        else:
            action()

    def _fault_action(self, kind: str, request: Request) -> Callable[[], None]:
        server = self._server
        makers: dict[str, Callable[[Request], Callable[[], None]]] = {
            "stall": self._stall,
            "unplug": self._unplug,
            "replug": lambda _: server.plug,
            "rate": self._rate,
            "dirty": lambda _: self._dirty,
            "drop": lambda _: server.drop_records,
        }
        return makers[kind](request)

    def _stall(self, request: Request) -> Callable[[], None]:
        """No record for ``value`` seconds, or until the faults are cleared; connections stay open."""
        length_s = float(request.get("value", 0.0))

        def stall() -> None:
            server = self._server
            server.stalled = True
            self._stalls += 1
            mine = self._stalls
            server.log.add("stall", time.monotonic())
            if length_s > 0:
                server.at(length_s, lambda: self._go_on(mine))

        return stall

    def _go_on(self, stall: int) -> None:
        if self._server.stalled and stall == self._stalls:
            self._server.stalled = False
            self._server.log.add("go_on", time.monotonic())

    def _unplug(self, request: Request) -> Callable[[], None]:
        server = self._server
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            server.unplug()
            if replug_after_s > 0:
                server.at(replug_after_s, server.plug)

        return unplug

    def _rate(self, request: Request) -> Callable[[], None]:
        rate_hz = float(request["value"])
        return lambda: self._server.set_rate(rate_hz)

    def _dirty(self) -> None:
        """A hand already holds everything: sticks deflected, bumper and start pressed."""
        self._server.axes.update(left_x=1.0, left_y=-1.0, right_x=1.0, right_y=-1.0)
        self._server.held.update(("left_bumper", "start", "a"))

    def _clear_faults(self, _: Request) -> None:
        """Ends all faults: it is plugged in, goes on, and has its first rate."""
        server = self._server
        self._go_on(self._stalls)
        server.plug()
        if server.rate_hz != self._rate_hz:
            server.set_rate(self._rate_hz)
