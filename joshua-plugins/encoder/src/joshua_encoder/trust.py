"""Plausibility check for encoder replies with weak check bits. Does no I/O.

Two check bits let one damaged reply in four pass, and a high bit of a position is a quarter of a turn. At the
start, and after each visibly damaged reply, a reply is therefore accepted only if it agrees with the previous
one. After ``TRUST_RUN`` valid replies in a row, each is accepted by itself.
"""

from __future__ import annotations

#: Valid replies in a row after which a line is trusted; not reached with one damaged byte in a hundred.
TRUST_RUN = 500

#: Noise of the encoder at standstill, in counts.
_NEAR = 2

#: Uncertainty of the time between two replies.
_JITTER_S = 0.001

#: Relative uncertainty of the motion if the speed is known from only two replies.
_JITTER_SHARE = 0.25


class Trust:
    """Judges the replies of one encoder.

    Args:
        resolution: counts per revolution.
    """

    def __init__(self, resolution: int) -> None:
        self._resolution = resolution
        self._run = 0
        self._damages = 0
        self._last: tuple[int, float] | None = None  # last accepted count
        self._speed = 0.0  # counts per second between accepted replies
        self._pending: tuple[int, float] | None = None
        self._pending_speed: float | None = None

    def begin(self) -> None:
        """Begin a new round of requests."""
        self._pending = self._pending_speed = None

    def damaged(self) -> None:
        """Report a damaged reply."""
        self._run = 0
        self._damages += 1

    def take(self, count: int, time_s: float, *, hurried: bool = False) -> bool:
        """Add a valid reply; return whether to accept it.

        Args:
            hurried: there is no time for another request, unless the line is known to be noisy.
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
        """Return whether a count agrees with the previous one at a recent speed."""
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
        """Return the signed distance between two positions, the shorter way."""
        half = self._resolution // 2
        return (second - first + half) % self._resolution - half
