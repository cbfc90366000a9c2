"""Time limits of endpoints: one thread that notices when something did not happen in time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Limit:
    """One time limit: counts from the first ``touch`` and expires when no other follows in time.

    Args:
        period_s: the longest time between two touches.
        expired: called once for each period that passes without a touch; runs on the watch thread.
        repeat: whether it goes on counting after it expired; else the next touch arms it again.
    """

    def __init__(self, period_s: float, expired: Callable[[], None], *, repeat: bool) -> None:
        self.period_s = period_s
        self.expired = expired
        self.repeat = repeat
        self.armed_s: float | None = None
        self.watch: Watch | None = None

    def touch(self) -> None:
        """Says that it happened."""
        sleeping = self.armed_s is None
        self.armed_s = time.monotonic()
        if sleeping and self.watch is not None:
            self.watch.wake()


class Watch:
    """Watches limits on one thread, which exists only while there are any."""

    def __init__(self) -> None:
        self._limits: list[Limit] = []
        self._condition = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False

    def add(self, limit: Limit) -> Limit:
        """Begins to watch a limit; it is armed by its first touch."""
        with self._condition:
            limit.watch = self
            self._limits.append(limit)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="joshua-qos-watch", daemon=True)
                self._thread.start()
            self._condition.notify()
        return limit

    def remove(self, limit: Limit) -> None:
        """Ends the watch over a limit; unknown limits are left alone."""
        with self._condition:
            if limit in self._limits:
                self._limits.remove(limit)

    def wake(self) -> None:
        """Lets the thread look at the limits anew."""
        with self._condition:
            self._condition.notify()

    def close(self) -> None:
        """Ends the thread."""
        with self._condition:
            self._closed = True
            self._limits.clear()
            self._condition.notify()
        if self._thread is not None and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while True:
            with self._condition:
                if self._closed:
                    return
                now = time.monotonic()
                due = [limit for limit in self._limits if self._remaining(limit, now) <= 0]
                if not due:
                    waits = [self._remaining(limit, now) for limit in self._limits]
                    shortest = min(waits, default=None)
                    self._condition.wait(None if shortest in (None, float("inf")) else shortest)
                    continue
                for limit in due:
                    limit.armed_s = now if limit.repeat else None
            for limit in due:
                limit.expired()

    @staticmethod
    def _remaining(limit: Limit, now: float) -> float:
        return float("inf") if limit.armed_s is None else limit.armed_s + limit.period_s - now
