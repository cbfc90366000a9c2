"""What the control channel can ask of emulated encoders."""

from __future__ import annotations

import time
from typing import Any

from joshua_emulator.encoder.device import AMT21, AS5600, EncoderDevice
from joshua_emulator.fault_rules import (
    LASTS,
    LINE_SPEED,
    PLAIN,
    PROBABILITY,
    RETURNS,
    SECONDS,
    FaultRule,
    Number,
)
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.operations import Action, Request
from joshua_emulator.station_operations import SensorOperations

NOISE = FaultRule(Number("1 to 4000 bytes", 1, 4000, whole=True), optional=True)


def fault_rules(protocol: str) -> dict[str, FaultRule]:
    """What each fault takes; some fit encoders of one protocol only."""
    answers = f"{protocol} encoders only answer, they send no lines to repeat"
    blind = f"{protocol} encoders do not say whether they see a magnet"
    return {
        **dict.fromkeys(LineFaults.KINDS, PROBABILITY),
        "stall": LASTS,
        "silent": LASTS,
        "freeze": FaultRule(SECONDS, optional=True, unfit=answers if protocol == AMT21 else ""),
        "no_magnet": FaultRule(SECONDS, optional=True, unfit="" if protocol == AS5600 else blind),
        "unplug": RETURNS,
        "replug": PLAIN,
        "rate": LINE_SPEED,
        "dirty": NOISE,
        "turn": FaultRule(SECONDS),
    }


class EncoderOperations(SensorOperations):
    """Operations by name. ``handle`` is the control channel's handler."""

    def __init__(self, device: EncoderDevice, name: str) -> None:
        super().__init__(device.log, fault_rules(device.protocol), device.faults, name)
        self._device = device
        self.operations = {
            "state": self._state,
            "angle": lambda request: {"angle_rad": device.shaft.angle_rad(int(request["t_ns"]) / 1e9)},
            "log": self.read_log,
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: self.home.stop(),
        }
        self.makers = {
            "stall": self._stall,
            "silent": lambda request: self._switch("silent", request),
            "freeze": lambda request: self._switch("frozen", request),
            "no_magnet": lambda request: self._switch("no_magnet", request),
            "unplug": self.unplug,
            "replug": lambda _: self.replug,
            "rate": lambda request: self.rate(request, device),
            "dirty": self.dirty,
            "turn": self._turn,
        }

    def _state(self, _: Request) -> dict[str, Any]:
        device, now_s = self._device, time.monotonic()
        return {
            "t_ns": round(now_s * 1e9),
            "angle_rad": device.shaft.angle_rad(now_s),
            "plugged": self.home.line.plugged,
            "baudrate": device.baudrate,
            "sent": device.sent,
            "faults": device.faults.describe(),
            "fault_counts": dict(device.faults.counts),
        }

    def _switch(self, name: str, request: Request) -> Action:
        """Switch a fault of the device on for ``value`` seconds, or until the faults are cleared."""

        def switch() -> None:
            setattr(self._device, name, True)
            self.log.add(name, time.monotonic())

        return self.lasting(name, request, switch, lambda: setattr(self._device, name, False))

    def _stall(self, request: Request) -> Action:
        """Hold the shaft fast for ``value`` seconds, or until the faults are cleared."""
        shaft = self._device.shaft

        def stall() -> None:
            shaft.hold(time.monotonic())

        return self.lasting("stall", request, stall, lambda: shaft.release(time.monotonic()))

    def _turn(self, request: Request) -> Action:
        """Let the shaft turn for ``value`` seconds, then holds it fast."""
        length_s = float(request["value"])
        return lambda: self._device.shaft.release(time.monotonic(), length_s)

    def _clear_faults(self, _: Request) -> None:
        """End all faults: the encoders are plugged in, turn and talk as at the start."""
        device = self._device
        self.end_lasting()
        device.faults.clear()
        device.silent = device.frozen = device.no_magnet = False
        device.baudrate = device.original_baudrate
        device.shaft.release(time.monotonic())
        self.replug()
