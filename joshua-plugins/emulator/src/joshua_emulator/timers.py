"""Delayed actions of an emulated device's loop."""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable

#: Longest single wait, because the system accepts no timeout of years.
LONGEST_WAIT_S = 60.0


class Timers:
    """Actions and when they are due, by the monotonic clock."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, Callable[[], object]]] = []
        self._order = itertools.count()

    def at(self, delay_s: float, action: Callable[[], object]) -> None:
        """Have ``action`` called after a delay."""
        heapq.heappush(self._entries, (time.monotonic() + delay_s, next(self._order), action))

    def run_due(self, now_s: float) -> None:
        """Run the due actions."""
        while self._entries and self._entries[0][0] <= now_s:
            heapq.heappop(self._entries)[2]()

    @property
    def next_s(self) -> float:
        """When the next action is due; inf if there is none."""
        return self._entries[0][0] if self._entries else float("inf")


def wait_s(deadline_s: float) -> float:
    """How long a loop may wait for something that is due at a time of the monotonic clock."""
    return min(max(0.0, deadline_s - time.monotonic()), LONGEST_WAIT_S)
