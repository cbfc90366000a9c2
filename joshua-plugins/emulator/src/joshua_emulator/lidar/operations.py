"""Operations of the control channel for an emulated scanner."""

from __future__ import annotations

import time
from typing import Any

from joshua_emulator.fault_rules import (
    LASTS,
    LINE_SPEED,
    PLAIN,
    PROBABILITY,
    RETURNS,
    FaultRule,
    Number,
)
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.lidar.models import ScannerModel
from joshua_emulator.lidar.scanner import Scanner
from joshua_emulator.operations import Action, Request
from joshua_emulator.station_operations import SensorOperations


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


class ScannerOperations(SensorOperations):
    """Operations by name. ``handle`` is the control channel's handler."""

    def __init__(self, scanner: Scanner, name: str) -> None:
        super().__init__(scanner.log, fault_rules(scanner.model), scanner.faults, name)
        self._scanner = scanner
        self.operations = {
            "state": self._state,
            "log": self.read_log,
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: self.home.stop(),
        }
        self.makers = {
            "stall": self._stall,
            "silent": self._silent,
            "turn_hz": self._turn,
            "unplug": self.unplug,
            "replug": lambda _: self.replug,
            "rate": lambda request: self.rate(request, scanner),
            "dirty": self.dirty,
            "health": self._health,
            "old_firmware": lambda _: lambda: setattr(scanner, "old_firmware", True),
        }

    def _state(self, _: Request) -> dict[str, Any]:
        scanner = self._scanner
        return {
            "t_ns": time.monotonic_ns(),
            "model": scanner.model.name,
            "plugged": self.home.line.plugged,
            "scanning": scanner.scanning,
            "motor": scanner.motor,
            "turn_hz": scanner.turn_hz,
            "baudrate": scanner.baudrate,
            "packets": scanner.packets,
            "faults": scanner.faults.describe(),
            "fault_counts": dict(scanner.faults.counts),
        }

    def _stall(self, request: Request) -> Action:
        """Hold the motor fast for ``value`` seconds, or until the faults are cleared."""

        def stall() -> None:
            self._scanner.set_turn_hz(0.0)
            self.log.add("stall", time.monotonic())

        def go_on() -> None:
            self._turn_as_usual()
            self.log.add("go_on", time.monotonic())

        return self.lasting("stall", request, stall, go_on)

    def _silent(self, request: Request) -> Action:
        """Send nothing for ``value`` seconds, or until the faults are cleared."""

        def silence() -> None:
            self._scanner.silent = True
            self.log.add("silent", time.monotonic())

        return self.lasting("silent", request, silence, lambda: setattr(self._scanner, "silent", False))

    def _turn(self, request: Request) -> Action:
        turn_hz = float(request["value"])
        return lambda: self._scanner.set_turn_hz(turn_hz)

    def _turn_as_usual(self) -> None:
        self._scanner.set_turn_hz(self._scanner.model.turn_hz)

    def _health(self, request: Request) -> Action:
        status = int(request["value"])
        return lambda: setattr(self._scanner, "health", status)

    def _clear_faults(self, _: Request) -> None:
        """End all faults: the scanner is plugged in, turns and talks as at the start."""
        scanner = self._scanner
        self.end_lasting()
        scanner.faults.clear()
        scanner.silent = scanner.old_firmware = False
        scanner.health, scanner.baudrate = 0, scanner.model.baudrate
        self._turn_as_usual()
        self.replug()
