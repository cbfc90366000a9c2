"""From counts to a position that continues over any number of turns, and a velocity."""

from __future__ import annotations

import math
from collections import deque

#: The velocity is that of this last stretch of time, or of the last two counts where they lie farther apart.
VELOCITY_WINDOW_NS = 50_000_000

_NS_PER_S = 1_000_000_000


class Tracker:
    """Follows one encoder.

    Args:
        resolution: counts in one revolution.
        modulus: number of different counts after which the encoder starts again; 0: it never does.
        inverted: counts the other way round.
    """

    def __init__(self, resolution: int, modulus: int, *, inverted: bool) -> None:
        self._rad = (-1 if inverted else 1) * math.tau / resolution
        self._modulus = modulus
        self._last: int | None = None
        self._recent: deque[tuple[int, int]] = deque()
        self.ticks = 0

    @property
    def position_rad(self) -> float:
        """Position; of an encoder that knows its angle, from its own zero on."""
        return self.ticks * self._rad

    @property
    def velocity_rad_s(self) -> float:
        """Velocity; 0 before the second count."""
        if len(self._recent) < 2:
            return 0.0
        (first_ns, first), (last_ns, last) = self._recent[0], self._recent[-1]
        return (last - first) * self._rad * _NS_PER_S / (last_ns - first_ns)

    def resume(self) -> None:
        """Begin a new stretch of time after a pause; the turns so far stay."""
        self._recent.clear()

    def add(self, count: int, time_ns: int) -> None:
        """Take a count and its time, of any clock that continues.

        An encoder that starts again after ``modulus`` counts is taken to have gone the shorter way, so it
        must be read more than twice while it passes them all.
        """
        if self._last is None or not self._modulus:
            self.ticks = count
        else:
            half = self._modulus // 2
            self.ticks += (count - self._last + half) % self._modulus - half
        self._last = count
        if self._recent and time_ns <= self._recent[-1][0]:
            self._recent.clear()  # the clock of the sender began again
        self._recent.append((time_ns, self.ticks))
        while len(self._recent) > 2 and time_ns - self._recent[1][0] >= VELOCITY_WINDOW_NS:
            self._recent.popleft()
