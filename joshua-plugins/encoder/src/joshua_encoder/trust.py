"""Whether an answer of an encoder counts whose check bits are weak; no input or output.

Two check bits let one damaged answer in four pass, and a high bit of a position is a quarter of a turn. So at
the start, and after each answer that shows damage, an answer counts only once it goes with another one that
was asked for just before; when ``TRUST_RUN`` in a row were whole, each counts by itself.
"""

from __future__ import annotations

#: Whole answers in a row after which a line is trusted. With one damaged byte in a hundred none is so long.
TRUST_RUN = 500

#: How far apart two answers of a shaft that stands still may be, in counts: the encoder's own noise.
_NEAR = 2

#: How inexactly the time between two answers is known.
_JITTER_S = 0.001

#: The same, as share of the way, where the speed is known from two answers alone.
_JITTER_SHARE = 0.25


class Trust:
    """Judges the answers of one encoder.

    Args:
        resolution: counts in one revolution.
    """

    def __init__(self, resolution: int) -> None:
        self._resolution = resolution
        self._run = 0
        self._damages = 0
        self._last: tuple[int, float] | None = None  # that counted
        self._speed = 0.0  # counts a second between those that counted
        self._pending: tuple[int, float] | None = None
        self._pending_speed: float | None = None

    def begin(self) -> None:
        """A new round of questions begins."""
        self._pending = self._pending_speed = None

    def damaged(self) -> None:
        """An answer showed damage."""
        self._run = 0
        self._damages += 1

    def take(self, count: int, time_s: float, *, hurried: bool = False) -> bool:
        """Take a whole answer; return whether it counts.

        Args:
            hurried: there is no time to ask again, unless the line is known to damage answers.
        """
        self._run += 1
        trusted = self._run > TRUST_RUN or (hurried and not self._damages)
        agreed = self._agrees(count, time_s)
        if not (trusted or agreed):
            return False
        if self._last is not None and time_s > self._last[1]:
            self._speed = self._way(self._last[0], count) / (time_s - self._last[1])
        self._last = (count, time_s)
        return True

    def _agrees(self, count: int, time_s: float) -> bool:
        """Whether it goes with the one before, at the speed of late or that of the two before."""
        before, self._pending = self._pending, (count, time_s)
        if before is None or time_s <= before[1]:
            return False
        passed_s = time_s - before[1]
        way = self._way(before[0], count)
        steady, self._pending_speed = self._pending_speed, way / passed_s
        if abs(way - self._speed * passed_s) <= _NEAR + abs(self._speed) * _JITTER_S:
            return True
        expected = steady * passed_s if steady is not None else 0.0
        return abs(way - expected) <= _NEAR + abs(expected) * _JITTER_SHARE

    def _way(self, first: int, second: int) -> int:
        """Count from one position to another, the shorter way."""
        half = self._resolution // 2
        return (second - first + half) % self._resolution - half
