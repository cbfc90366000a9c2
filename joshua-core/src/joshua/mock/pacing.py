"""Virtual sensors at a fixed rate, without drift and without bunching."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

from joshua.devices.context import SensorContext
from joshua.devices.errors import DeviceError
from joshua.devices.sensor import Reading, Sensor
from joshua.node import ros_time

NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Tick:
    """One acquisition of a free-running sensor: its running number and its stamp."""

    sequence: int
    stamp_ns: int


class FreeRunningClock:
    """The acquisition clock of a sensor that runs whether or not somebody reads.

    Acquisition k happens at start + k·period on the monotonic clock. A reader that comes late finds the
    newest one; those in between are lost, never delivered in a bunch.

    Args:
        rate_hz: acquisitions per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        wall_ns = time.time_ns()  # first: held up between the two, no stamp may lie in the future
        self._start_ns = time.monotonic_ns()
        self._epoch_ns = wall_ns - self._start_ns
        self._next = 0

    def wait(self, timeout_s: float) -> Tick | None:
        """Waits for the next acquisition that has not been delivered; None when none came in time."""
        now_ns = time.monotonic_ns()
        due_ns = self._start_ns + round(self._next * self._period_ns)
        if now_ns < due_ns:
            wait_ns = due_ns - now_ns
            if wait_ns > timeout_s * NS_PER_S:
                time.sleep(max(timeout_s, 0.0))
                return None
            time.sleep(wait_ns / NS_PER_S)
            now_ns = time.monotonic_ns()
        newest = max(self._next, int((now_ns - self._start_ns) / self._period_ns))
        self._next = newest + 1
        if ros_time.is_simulated():
            return Tick(newest, ros_time.now_ns())
        return Tick(newest, self._epoch_ns + self._start_ns + round(newest * self._period_ns))


class FreeRunningSensor(Sensor):
    """A virtual sensor that acquires at its rate from ``connect`` on."""

    def __init__(self, settings: Any, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self._clock: FreeRunningClock | None = None

    @abstractmethod
    def start(self) -> float:
        """Begins anew; returns the rate in Hz."""

    @abstractmethod
    def acquire(self, tick: Tick) -> Any:
        """Makes the data of one acquisition."""

    @property
    def connected(self) -> bool:
        """Whether the sensor runs."""
        return self._clock is not None

    def connect(self) -> None:
        """Starts the sensor."""
        if self.connected:
            raise DeviceError(f"{type(self).__name__}.connect: the device is open already")
        self._clock = FreeRunningClock(self.start())

    def read(self, timeout_s: float) -> Reading | None:
        """Waits for the next acquisition; None when none came in time."""
        self.require_connected("read")
        assert self._clock is not None
        tick = self._clock.wait(timeout_s)
        return None if tick is None else Reading(tick.stamp_ns, tick.sequence, self.acquire(tick))

    def disconnect(self) -> None:
        """Stops the sensor; a second call does nothing."""
        self._clock = None
