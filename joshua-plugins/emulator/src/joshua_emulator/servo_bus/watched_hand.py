"""The time of a hand that waits for the eye: it moves a joint only as fast as somebody looks at it."""

from __future__ import annotations

from collections.abc import Callable

#: How far the hand continues from one look to the next; shorter than its rest at the ends of a range.
LOOK_S = 0.02


class WatchedTime:
    """Turns the clock into the time of a hand that was asked to move a joint through its range.

    Whoever calibrates must see every part of the way, as a person sees to it. So the hand rests while the bus
    is not read, however long the reader or this program stands still; while the adapter is unplugged it
    continues. Before the first read every look counts, such as one over the control channel.

    Args:
        now_s: when the hand starts.
        reads: how often the bus was read so far.
        unplugged_s: how long the adapter was away in all, up to a time.
    """

    def __init__(self, now_s: float, reads: Callable[[], int], unplugged_s: Callable[[float], float]) -> None:
        self._reads = reads
        self._unplugged_s = unplugged_s
        self._first = self._last_read = reads()
        self._last_s = now_s
        self._away_s = unplugged_s(now_s)
        self._left_s = LOOK_S
        self._elapsed_s = 0.0

    def __call__(self, now_s: float) -> float:
        """Seconds of the hand at a time of the monotonic clock."""
        if now_s <= self._last_s:
            return self._elapsed_s
        reads, away_s = self._reads(), self._unplugged_s(now_s)
        if reads != self._last_read or reads == self._first:
            self._last_read, self._left_s = reads, LOOK_S
        unseen_s = away_s - self._away_s
        step_s = min(max(0.0, now_s - self._last_s - unseen_s), self._left_s)
        self._left_s -= step_s
        self._elapsed_s += step_s + unseen_s
        self._last_s, self._away_s = now_s, away_s
        return self._elapsed_s
