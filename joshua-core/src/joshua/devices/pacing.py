"""Clocks of virtual sensors and of publishers: a fixed rate without drift and without bunching."""

from __future__ import annotations

import time
from dataclasses import dataclass

NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Tick:
    """One acquisition of a free-running sensor: its running number and its stamp in ns since the epoch."""

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
        self._start_ns = time.monotonic_ns()
        self._epoch_ns = time.time_ns() - self._start_ns
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
        return Tick(newest, self._epoch_ns + self._start_ns + round(newest * self._period_ns))


class RateLimit:
    """Thins a stream of stamped readings to a rate, without a beat between the two rates.

    A reading passes when it lies nearer to the next due time than the reading after it would, judged by
    the distance of the last two; so a 30 Hz camera published at 30 Hz loses no frame to jitter.

    Args:
        rate_hz: largest rate of readings that pass, on average.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._due_ns: float | None = None
        self._last_ns: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Whether the reading with this stamp is published."""
        distance_ns = stamp_ns - self._last_ns if self._last_ns is not None else 0
        self._last_ns = stamp_ns
        if self._due_ns is None:
            self._due_ns = stamp_ns + self._period_ns
            return True
        tolerance_ns = min(distance_ns, self._period_ns) / 2
        if stamp_ns < self._due_ns - tolerance_ns:
            return False
        late = stamp_ns - self._due_ns > self._period_ns
        self._due_ns = (stamp_ns if late else self._due_ns) + self._period_ns
        return True
