"""What the control channel can ask of emulated encoders."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from joshua_emulator.control import ControlError
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
    check_fault,
)
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.station import Station

Request = dict[str, Any]

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
    }


class EncoderOperations:
    """Operations by name; ``handle`` is the control channel's handler."""

    def __init__(self, device: EncoderDevice, name: str) -> None:
        self.station: Station | None = None  # set before the channel opens
        self._device = device
        self._name = name
        self._rules = fault_rules(device.protocol)
        self._operations: dict[str, Callable[[Request], dict[str, Any] | None]] = {
            "state": self._state,
            "angle": lambda request: {"angle_rad": device.shaft.angle_rad(int(request["t_ns"]) / 1e9)},
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
        device, now_s = self._device, time.monotonic()
        return {
            "t_ns": round(now_s * 1e9),
            "angle_rad": device.shaft.angle_rad(now_s),
            "plugged": self._home.line.plugged,
            "baudrate": device.baudrate,
            "sent": device.sent,
            "faults": device.faults.describe(),
            "fault_counts": dict(device.faults.counts),
        }

    def _read_log(self, request: Request) -> dict[str, Any]:
        entries = self._device.log.since(
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
        device = self._device
        if kind in LineFaults.KINDS:
            value = request["value"]
            return lambda: device.faults.set(kind, value)
        makers: dict[str, Callable[[Request], Callable[[], None]]] = {
            "stall": self._stall,
            "silent": lambda asked: self._switch("silent", asked),
            "freeze": lambda asked: self._switch("frozen", asked),
            "no_magnet": lambda asked: self._switch("no_magnet", asked),
            "unplug": self._unplug,
            "replug": lambda _: self._replug,
            "rate": self._rate,
            "dirty": self._dirty,
        }
        return makers[kind](request)

    def _switch(self, name: str, request: Request) -> Callable[[], None]:
        """Switches a fault of the device on for ``value`` seconds, or until the faults are cleared."""
        length_s = float(request.get("value", 0.0))

        def switch() -> None:
            setattr(self._device, name, True)
            self._device.log.add(name, time.monotonic())
            if length_s > 0:
                self._home.at(length_s, lambda: setattr(self._device, name, False))

        return switch

    def _stall(self, request: Request) -> Callable[[], None]:
        """Holds the shaft fast for ``value`` seconds, or until the faults are cleared."""
        length_s = float(request.get("value", 0.0))
        shaft = self._device.shaft

        def stall() -> None:
            shaft.held_rad = shaft.angle_rad(time.monotonic())
            if length_s > 0:
                self._home.at(length_s, lambda: setattr(shaft, "held_rad", None))

        return stall

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
        """Talks at another line speed."""
        baudrate = int(request["value"])
        return lambda: setattr(self._device, "baudrate", baudrate)

    def _dirty(self, request: Request) -> Callable[[], None]:
        """Sends ``value`` bytes of noise and then the second half of a line."""
        count = int(request.get("value", 100))
        return lambda: self._device.faults.begin_dirty(count)

    def _clear_faults(self, _: Request) -> None:
        """Ends all faults: the encoders are plugged in, turn and talk as at the start."""
        device = self._device
        device.faults.clear()
        device.silent = device.frozen = device.no_magnet = False
        device.baudrate = device.original_baudrate
        device.shaft.held_rad = None
        self._replug()
