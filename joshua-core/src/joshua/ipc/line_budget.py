"""Rate limit of log lines. Lines above it are dropped and counted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

#: Lines that a node may write in one second.
LINES_PER_S = 200


class LineBudget:
    """Allows a number of lines in each second and counts the dropped ones. Thread-safe.

    Args:
        lines_per_s: lines allowed in each second.
        clock: monotonic seconds.
    """

    def __init__(self, lines_per_s: int = LINES_PER_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._lines_per_s = lines_per_s
        self._clock = clock
        self._window_began_s = clock()
        self._used = 0
        self._dropped = 0
        self._lock = threading.Lock()

    def take(self) -> bool:
        """Returns whether one more line may be written, and counts it as dropped if not."""
        with self._lock:
            allowed = not self._exhausted()
            self._used += allowed
            self._dropped += not allowed
            return allowed

    def drop_if_exhausted(self, lines: int) -> bool:
        """Returns whether no line is allowed in this second, and counts ``lines`` as dropped if so."""
        with self._lock:
            exhausted = self._exhausted()
            self._dropped += lines * exhausted
            return exhausted

    def settle(self, *, ended: bool = False) -> int:
        """Returns and resets the count of dropped lines, once lines are allowed again or at the end."""
        with self._lock:
            if self._exhausted() and not ended:
                return 0
            dropped, self._dropped = self._dropped, 0
            return dropped

    def _exhausted(self) -> bool:
        now_s = self._clock()
        if now_s - self._window_began_s >= 1.0:
            self._window_began_s, self._used = now_s, 0
        return self._used >= self._lines_per_s
