"""Simulated time against the wall clock: how many steps are due, without drift."""

from __future__ import annotations

import time
from collections.abc import Callable

#: Longest lag that is caught up; beyond it the clock is set anew, so that a stall causes no burst.
LARGEST_LAG_S = 0.1


class Pacer:
    """Tells how many steps are due so that simulated time runs ``factor`` times as fast as the clock.

    Args:
        timestep_s: simulated time of one step.
        factor: 1 for real time; 0 for as fast as possible.
        clock: seconds, monotonic.

    Attributes:
        dropped_s: simulated time that was given up because the machine could not keep up.
    """

    def __init__(
        self, timestep_s: float, factor: float = 1.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._timestep_s = timestep_s
        self.factor = factor
        self._clock = clock
        self.dropped_s = 0.0
        self.restart()

    def restart(self) -> None:
        """Starts to count now, as after a pause."""
        self._origin_s = self._clock()
        self._steps = 0

    def due(self) -> int:
        """Number of steps that are due now; without a factor always one chunk of 1/60 s."""
        if self.factor <= 0:
            return max(1, round(1 / 60 / self._timestep_s))
        wanted = int((self._clock() - self._origin_s) * self.factor / self._timestep_s + 1e-9)
        due = wanted - self._steps
        largest = max(1, int(LARGEST_LAG_S * self.factor / self._timestep_s))
        if due > largest:
            self.dropped_s += (due - largest) * self._timestep_s
            self._steps += due - largest
            due = largest
        self._steps += due
        return due

    def wait_s(self) -> float:
        """Wall time until the next step is due; 0 when it is."""
        if self.factor <= 0:
            return 0.0
        next_s = self._origin_s + (self._steps + 1) * self._timestep_s / self.factor
        return max(0.0, next_s - self._clock())
