"""What the control channel can ask of an emulated scanner."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from joshua_emulator.control import ControlError
from joshua_emulator.fault_rules import (
    LASTS,
    LINE_SPEED,
    PLAIN,
    PROBABILITY,
    RETURNS,
    FaultRule,
    Number,
    check_fault,
)
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.lidar.models import ScannerModel
from joshua_emulator.lidar.scanner import Scanner
from joshua_emulator.station import Station

Request = dict[str, Any]


def fault_rules(model: ScannerModel) -> dict[str, FaultRule]:
    """What each fault takes; some fit scanners only that can be asked."""
    dumb = f"{model.name} scanners report no health"
    plain = f"{model.name} scanners have one kind of scan only"
    return {
        **dict.fromkeys(LineFaults.KINDS, PROBABILITY),
        "stall": LASTS,
        "silent": LASTS,
        "turn_hz": FaultRule(Number("0 to 50 Hz", 0, 50)),
        "unplug": RETURNS,
        "replug": PLAIN,
        "rate": LINE_SPEED,
        "dirty": FaultRule(Number("1 to 4000 bytes", 1, 4000, whole=True), optional=True),
        "health": FaultRule(
            Number("0 (good), 1 (warning), 2 (error)", 0, 2, whole=True), unfit="" if model.number else dumb
        ),
        "old_firmware": FaultRule(unfit="" if model.express_hz else plain),
    }


class ScannerOperations:
    """Operations by name; ``handle`` is the control channel's handler."""

    def __init__(self, scanner: Scanner, name: str) -> None:
        self.station: Station | None = None  # set before the channel opens
        self._scanner = scanner
        self._name = name
        self._rules = fault_rules(scanner.model)
        self._operations: dict[str, Callable[[Request], dict[str, Any] | None]] = {
            "state": self._state,
            "log": self._read_log,
            "fault": self._fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: self._home.stop(),
        }

    @property
    def _home(self) -> Station:
        assert self.station is not None
        return self.station

    def handle(self, request: Request) -> dict[str, Any]:
        """Carries out one request. Raises ControlError."""
        operation = self._operations.get(request["op"])
        if operation is None:
            raise ControlError(f"unknown operation {request['op']!r}; allowed: {', '.join(self._operations)}")
        try:
            return operation(request) or {}
        except KeyError as error:
            raise ControlError(f"{request['op']}: {error.args[0]!r} is missing") from error
        except FileExistsError as error:
            raise ControlError(f"{request['op']}: {error}") from error
        except (TypeError, ValueError) as error:
            raise ControlError(f"{request['op']}: a value is wrong ({error})") from error

    def _state(self, _: Request) -> dict[str, Any]:
        scanner = self._scanner
        return {
            "t_ns": time.monotonic_ns(),
            "model": scanner.model.name,
            "plugged": self._home.line.plugged,
            "scanning": scanner.scanning,
            "motor": scanner.motor,
            "turn_hz": scanner.turn_hz,
            "baudrate": scanner.baudrate,
            "packets": scanner.packets,
            "faults": scanner.faults.describe(),
            "fault_counts": dict(scanner.faults.counts),
        }

    def _read_log(self, request: Request) -> dict[str, Any]:
        entries = self._scanner.log.since(
            int(request.get("since", 0)), request.get("events", ()), int(request.get("limit", 10_000))
        )
        return {"entries": entries}

    def _fault(self, request: Request) -> None:
        """Brings a fault about: ``kind``, its ``value`` and settings, ``at_s`` seconds from now on."""
        check_fault(request, self._rules)
        action = self._action(request["kind"], request)
        delay_s = float(request.get("at_s", 0.0))
        if delay_s > 0:
            self._home.at(delay_s, action)
        else:
            action()

    def _action(self, kind: str, request: Request) -> Callable[[], None]:
        scanner = self._scanner
        if kind in LineFaults.KINDS:
            value = request["value"]
            return lambda: scanner.faults.set(kind, value)
        makers: dict[str, Callable[[Request], Callable[[], None]]] = {
            "stall": self._stall,
            "silent": self._silent,
            "turn_hz": self._turn,
            "unplug": self._unplug,
            "replug": lambda _: self._replug,
            "rate": self._rate,
            "dirty": self._dirty,
            "health": self._health,
            "old_firmware": lambda _: lambda: setattr(scanner, "old_firmware", True),
        }
        return makers[kind](request)

    def _stall(self, request: Request) -> Callable[[], None]:
        """Holds the motor fast for ``value`` seconds, or until the faults are cleared."""
        length_s = float(request.get("value", 0.0))

        def stall() -> None:
            self._scanner.set_turn_hz(0.0)
            self._scanner.log.add("stall", time.monotonic())
            if length_s > 0:
                self._home.at(length_s, self._go_on)

        return stall

    def _go_on(self) -> None:
        self._scanner.set_turn_hz(self._scanner.model.turn_hz)
        self._scanner.log.add("go_on", time.monotonic())

    def _silent(self, request: Request) -> Callable[[], None]:
        """Sends nothing for ``value`` seconds, or until the faults are cleared."""
        length_s = float(request.get("value", 0.0))

        def silence() -> None:
            self._scanner.silent = True
            self._scanner.log.add("silent", time.monotonic())
            if length_s > 0:
                self._home.at(length_s, lambda: setattr(self._scanner, "silent", False))

        return silence

    def _turn(self, request: Request) -> Callable[[], None]:
        turn_hz = float(request["value"])
        return lambda: self._scanner.set_turn_hz(turn_hz)

    def _unplug(self, request: Request) -> Callable[[], None]:
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            self._home.unplug()
            if replug_after_s > 0:
                self._home.at(replug_after_s, self._replug)

        return unplug

    def _replug(self) -> None:
        if not self._home.line.plugged:
            self._home.replug(self._name)

    def _rate(self, request: Request) -> Callable[[], None]:
        """Talks at another line speed, as a scanner of another make would."""
        baudrate = int(request["value"])
        return lambda: setattr(self._scanner, "baudrate", baudrate)

    def _dirty(self, request: Request) -> Callable[[], None]:
        """Sends ``value`` bytes of noise and then the second half of a packet."""
        count = int(request.get("value", 100))
        return lambda: self._scanner.faults.begin_dirty(count)

    def _health(self, request: Request) -> Callable[[], None]:
        status = int(request["value"])
        return lambda: setattr(self._scanner, "health", status)

    def _clear_faults(self, _: Request) -> None:
        """Ends all faults: the scanner is plugged in, turns and talks as at the start."""
        scanner = self._scanner
        scanner.faults.clear()
        scanner.silent = scanner.old_firmware = False
        scanner.health, scanner.baudrate = 0, scanner.model.baudrate
        scanner.set_turn_hz(scanner.model.turn_hz)
        self._replug()
