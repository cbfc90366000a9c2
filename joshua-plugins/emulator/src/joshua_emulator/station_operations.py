"""Operations of the control channel for an emulated device at a serial line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from joshua_emulator.event_log import EventLog
from joshua_emulator.fault_rules import FaultRule
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.operations import Action, DeviceOperations, Request
from joshua_emulator.station import Station


class StationOperations(DeviceOperations):
    """Operations of a device on a ``Station``, which is set before the channel opens."""

    refusals: ClassVar[tuple[type[Exception], ...]] = (FileExistsError,)

    def __init__(self, log: EventLog, rules: Mapping[str, FaultRule]) -> None:
        super().__init__(log, rules)
        self.station: Station | None = None

    @property
    def home(self) -> Station:
        """The station."""
        assert self.station is not None
        return self.station

    def at(self, delay_s: float, action: Action) -> None:
        """Call ``action`` after a delay, on the loop of the station."""
        self.home.at(delay_s, action)


class SensorOperations(StationOperations):
    """Operations of a sensor that sends by itself: the faults of its line.

    Args:
        log: of the device; rules: what each of its faults takes; faults: of its line; name: of its port.
    """

    def __init__(self, log: EventLog, rules: Mapping[str, FaultRule], faults: LineFaults, name: str) -> None:
        super().__init__(log, rules)
        self._faults = faults
        self._name = name
        #: What makes the action of a fault, by its kind.
        self.makers: dict[str, Callable[[Request], Action]] = {}

    def fault_action(self, kind: str, request: Request) -> Action:
        """The action that injects a valid fault."""
        if kind in LineFaults.KINDS:
            value = request["value"]
            return lambda: self._faults.set(kind, value)
        return self.makers[kind](request)

    def unplug(self, request: Request) -> Action:
        """Unplug the adapter, and plug it in again after ``replug_after_s``."""
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            self.home.unplug()
            if replug_after_s > 0:
                self.later(replug_after_s, self.replug)

        return unplug

    def replug(self) -> None:
        """Plug the adapter in again; no effect if it is connected."""
        if not self.home.line.plugged:
            self.home.replug(self._name)

    def rate(self, request: Request, device: object) -> Action:
        """Switch to another line speed, like a device of another make."""
        baudrate = int(request["value"])
        return lambda: setattr(device, "baudrate", baudrate)

    def dirty(self, request: Request) -> Action:
        """Send ``value`` bytes of noise and then the second half of a packet."""
        count = int(request.get("value", 100))
        return lambda: self._faults.begin_dirty(count)
