"""Fixed-rate timers on the monotonic clock: absolute deadlines, no drift, no bunching."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from joshua.node.cadence import NS_PER_S, TimerCadence


class Timer:
    """One fixed-rate timer.

    Its deadlines are start + k·period. A tick that is late by more than a period runs once. The missed
    deadlines are counted as overruns and skipped.

    Args:
        period_s: interval of the deadlines.
        callback: called at each.
        name: name in the report.

    Raises:
        ValueError: the period is not a positive number.
    """

    def __init__(self, period_s: float, callback: Callable[[], None], name: str) -> None:
        if not (math.isfinite(period_s) and period_s > 0):
            raise ValueError(f"timer {name!r}: the period is {period_s} s; it must be positive")
        self.name = name
        self.cadence = TimerCadence(name, period_s)
        self._period_ns = max(1, round(period_s * NS_PER_S))
        self._callback = callback
        self._deadline_ns: int | None = None
        self._earliest_ns = 0

    @property
    def deadline_ns(self) -> int | None:
        """Next deadline on the monotonic clock; None before the start."""
        return self._deadline_ns

    @property
    def due_ns(self) -> int:
        """When the next tick runs: its deadline, or later after ``wait_until``; 0 before the start."""
        return 0 if self._deadline_ns is None else max(self._deadline_ns, self._earliest_ns)

    def start(self, now_ns: int) -> None:
        """Sets the first deadline one period from now. No effect on a running timer."""
        if self._deadline_ns is None:
            self._deadline_ns = now_ns + self._period_ns

    def schedule(self, deadline_ns: int) -> None:
        """Moves the next deadline, and all later ones with it. On the node's thread.

        Periods by which it comes later count as overruns.
        """
        if self._deadline_ns is not None:
            skipped = round((deadline_ns - self._deadline_ns) / self._period_ns)
            self.cadence.skip(max(0, skipped))
        self._deadline_ns = deadline_ns

    def wait_until(self, earliest_ns: int) -> None:
        """Runs the next tick no earlier than at a time. Its deadline, and the later ones, stay."""
        self._earliest_ns = earliest_ns

    def run_if_due(self, now_ns: int) -> bool:
        """Calls back if the deadline has passed, and sets the next one. Returns whether it was called."""
        deadline_ns = self._deadline_ns
        if deadline_ns is None or now_ns < self.due_ns:
            return False
        missed = (now_ns - deadline_ns) // self._period_ns
        self.cadence.skip(missed)
        self.cadence.tick(deadline_ns, now_ns)
        self._deadline_ns = deadline_ns + (missed + 1) * self._period_ns
        self._callback()
        return True


class TimerQueue:
    """The timers of one node, run on the node's thread."""

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._clock = clock
        self._timers: list[Timer] = []
        self._running = False

    @property
    def timers(self) -> list[Timer]:
        """All timers, in the order of their creation."""
        return list(self._timers)

    def add(self, timer: Timer) -> None:
        """Adds a timer. It starts with the queue, or immediately if the queue runs."""
        self._timers.append(timer)
        if self._running:
            timer.start(self._clock())

    def start(self) -> None:
        """Starts all timers."""
        self._running = True
        now_ns = self._clock()
        for timer in self._timers:
            timer.start(now_ns)

    def run_due(self) -> int | None:
        """Runs each timer that is due, the most overdue first.

        Returns:
            Nanoseconds until the next deadline, 0 if one has passed meanwhile; None without timers.
        """
        for timer in sorted(self._timers, key=_due):
            timer.run_if_due(self._clock())
        if not self._timers:
            return None
        return max(0, min(_due(timer) for timer in self._timers) - self._clock())


def _due(timer: Timer) -> int:
    return timer.due_ns
