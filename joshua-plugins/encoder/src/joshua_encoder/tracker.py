"""Multi-turn position and velocity from counts."""

from __future__ import annotations

import math
from collections import deque

#: Window of the velocity estimate; the last two counts are used if they lie farther apart.
VELOCITY_WINDOW_NS = 50_000_000

_NS_PER_S = 1_000_000_000


class Tracker:
    """Tracks one encoder.

    Args:
        resolution: counts per revolution.
        modulus: number of counts after which the encoder wraps; 0: never.
        inverted: count in the opposite direction.
    """

    def __init__(self, resolution: int, modulus: int, *, inverted: bool) -> None:
        self._rad = (-1 if inverted else 1) * math.tau / resolution
        self._modulus = modulus
        self._last: int | None = None
        self._recent: deque[tuple[int, int]] = deque()
        self.ticks = 0

    @property
    def position_rad(self) -> float:
        """Position; relative to its own zero for an absolute encoder."""
        return self.ticks * self._rad

    @property
    def velocity_rad_s(self) -> float:
        """Velocity; 0 before the second count."""
        if len(self._recent) < 2:
            return 0.0
        (first_ns, first), (last_ns, last) = self._recent[0], self._recent[-1]
        return (last - first) * self._rad * _NS_PER_S / (last_ns - first_ns)

    def resume(self) -> None:
        """Restart the velocity estimate after a pause; keep the turn count."""
        self._recent.clear()

    def add(self, count: int, time_ns: int) -> None:
        """Add a count and its time on any monotonic clock.

        An encoder that wraps after ``modulus`` counts is assumed to have moved the shorter way, so it must be
        read more than twice per wrap.
        """
        if self._last is None or not self._modulus:
            self.ticks = count
        else:
            half = self._modulus // 2
            self.ticks += (count - self._last + half) % self._modulus - half
        self._last = count
        if self._recent and time_ns <= self._recent[-1][0]:
            self._recent.clear()  # the sender's clock restarted
        self._recent.append((time_ns, self.ticks))
        while len(self._recent) > 2 and time_ns - self._recent[1][0] >= VELOCITY_WINDOW_NS:
            self._recent.popleft()
