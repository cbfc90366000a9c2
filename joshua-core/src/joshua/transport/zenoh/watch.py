"""Time limits of endpoints, watched by one thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Limit:
    """One time limit: starts at the first ``touch`` and expires if no other follows in time.

    Args:
        period_s: the longest time between two touches.
        expired: called once for each period without a touch, on the watch thread.
        repeat: whether it restarts after it expired. If not, the next touch arms it again.
    """

    def __init__(self, period_s: float, expired: Callable[[], None], *, repeat: bool) -> None:
        self.period_s = period_s
        self.expired = expired
        self.repeat = repeat
        self.armed_s: float | None = None
        self.watch: Watch | None = None

    def touch(self) -> None:
        """Restart the period."""
        sleeping = self.armed_s is None
        self.armed_s = time.monotonic()
        if sleeping and self.watch is not None:
            self.watch.wake()

    def remaining_s(self, now_s: float) -> float:
        """Time until it expires; infinite while it is not armed."""
        return float("inf") if self.armed_s is None else self.armed_s + self.period_s - now_s


class Watch:
    """Watches limits on one thread, which exists only while there are limits."""

    def __init__(self) -> None:
        self._limits: list[Limit] = []
        self._condition = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False

    def add(self, limit: Limit) -> Limit:
        """Watch a limit. Its first touch arms it."""
        with self._condition:
            limit.watch = self
            self._limits.append(limit)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="joshua-qos-watch", daemon=True)
                self._thread.start()
            self._condition.notify()
        return limit

    def remove(self, limit: Limit) -> None:
        """Stop watching a limit. No effect for an unknown limit."""
        with self._condition:
            if limit in self._limits:
                self._limits.remove(limit)

    def wake(self) -> None:
        """Make the thread check the limits again."""
        with self._condition:
            self._condition.notify()

    def close(self) -> None:
        """End the thread."""
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
                now_s = time.monotonic()
                due = [limit for limit in self._limits if limit.remaining_s(now_s) <= 0]
                if not due:
                    shortest_s = min(
                        (limit.remaining_s(now_s) for limit in self._limits), default=float("inf")
                    )
                    self._condition.wait(None if shortest_s == float("inf") else shortest_s)
                    continue
                for limit in due:
                    limit.armed_s = now_s if limit.repeat else None
            for limit in due:
                limit.expired()
