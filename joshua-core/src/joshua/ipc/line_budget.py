"""How many log lines a node may write: a flood is cut, and the cut is counted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

#: Lines that a node may write within one second.
LINES_PER_S = 200


class LineBudget:
    """Allows a number of lines in each second and counts those above it; thread-safe.

    Args:
        lines_per_s: lines allowed in each second.
        clock: returns seconds of a clock that never goes back.
    """

    def __init__(self, lines_per_s: int = LINES_PER_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._lines_per_s = lines_per_s
        self._clock = clock
        self._window_began_s = clock()
        self._used = 0
        self._dropped = 0
        self._lock = threading.Lock()

    @property
    def exhausted(self) -> bool:
        """Whether no more lines are allowed in this second."""
        with self._lock:
            self._renew()
            return self._used >= self._lines_per_s

    def take(self) -> tuple[bool, int]:
        """Asks for one line.

        Returns:
            Whether it may be written, and how many were dropped since the last one that was.
        """
        with self._lock:
            self._renew()
            if self._used >= self._lines_per_s:
                self._dropped += 1
                return False, 0
            self._used += 1
            return True, self._forget_dropped()

    def drop(self, lines: int) -> None:
        """Counts lines that were dropped unseen."""
        with self._lock:
            self._dropped += lines

    def settle(self) -> int:
        """Returns and forgets the count of dropped lines once more lines are allowed; else 0."""
        with self._lock:
            self._renew()
            return 0 if self._used >= self._lines_per_s else self._forget_dropped()

    def close(self) -> int:
        """Returns and forgets the count of dropped lines at the end of a node."""
        with self._lock:
            return self._forget_dropped()

    def _renew(self) -> None:
        now_s = self._clock()
        if now_s - self._window_began_s >= 1.0:
            self._window_began_s = now_s
            self._used = 0

    def _forget_dropped(self) -> int:
        dropped, self._dropped = self._dropped, 0
        return dropped
