"""Rates of streams: the one that was achieved, and the one that is allowed."""

from __future__ import annotations

import time
from collections.abc import Callable

from joshua.guardian.silence import AwakeClock, witness
from joshua.plan import NodeSpec

NS_PER_S = 1_000_000_000


class RateMeter:
    """Counts events and measures their mean rate between the first and the last one.

    Args:
        clock: nanoseconds that never run backwards.
        witness: knows when this process stood still, which is no fault of what sends the events.
    """

    def __init__(
        self, clock: Callable[[], int] = time.monotonic_ns, witness: AwakeClock | None = None
    ) -> None:
        self._clock = clock
        self._witness = witness
        self._first_ns = self._last_ns = 0
        self.count = 0

    def add(self) -> None:
        """Counts one event, now."""
        self._last_ns = self._clock()
        if not self.count:
            self._first_ns = self._last_ns
        self.count += 1

    @property
    def rate_hz(self) -> float:
        """Mean rate; 0 for fewer than two events."""
        elapsed_ns = self._last_ns - self._first_ns
        return (self.count - 1) * NS_PER_S / elapsed_ns if elapsed_ns else 0.0

    def check(self, name: str, wanted_hz: float, tolerance: float = 0.1) -> tuple[str, bool, str]:
        """A row of MODE_TEST: whether the rate is the configured one, within a fraction of it."""
        least_hz, most_hz, remark = self.rate_hz, self.rate_hz, ""
        elapsed_ns = self._last_ns - self._first_ns
        first_s, last_s = self._first_ns / NS_PER_S, self._last_ns / NS_PER_S
        held_ns = self._witness.missed_s(first_s, last_s) * NS_PER_S if self._witness else 0
        if 0 < held_ns < elapsed_ns:  # nobody knows how many events would have come
            most_hz *= elapsed_ns / (elapsed_ns - held_ns)
            remark = (
                f", {most_hz:.4g} Hz without {held_ns / NS_PER_S:.1f} s in which this machine stood still"
            )
        passed = least_hz <= wanted_hz * (1 + tolerance) and most_hz >= wanted_hz * (1 - tolerance)
        return (name, passed, f"{least_hz:.4g} Hz of {wanted_hz:g} Hz, {self.count} messages{remark}")


def meter_for(spec: NodeSpec) -> RateMeter:
    """A meter for a topic of a node; in MODE_TEST, which judges devices, it knows when the machine stood."""
    return RateMeter(witness=witness() if spec.facts.testing else None)


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
        if self._due_ns is None or distance_ns < 0:  # the first one, or a device that was opened again
            self._due_ns = stamp_ns + self._period_ns
            return True
        tolerance_ns = min(distance_ns, self._period_ns) / 2
        if stamp_ns < self._due_ns - tolerance_ns:
            return False
        late = stamp_ns - self._due_ns > self._period_ns
        self._due_ns = (stamp_ns if late else self._due_ns) + self._period_ns
        return True


def limit_below(rate_hz: float, source_hz: float) -> RateLimit | None:
    """The limit for a publisher of a source with a rate of its own; None where every one passes."""
    return RateLimit(rate_hz) if rate_hz < source_hz else None
