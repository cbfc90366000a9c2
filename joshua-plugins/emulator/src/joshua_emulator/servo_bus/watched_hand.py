"""Time base of a hand that moves a joint only as fast as the joint is read."""

from __future__ import annotations

from collections.abc import Callable

#: Longest motion between two reads; shorter than the rest at the ends of a range.
LOOK_S = 0.02


class WatchedTime:
    """Turns the clock into the time of a hand that was asked to move a joint through its range.

    A calibration must see the whole motion. The hand therefore pauses while the bus is not read, even if the
    reader or this program stalls, but continues while the adapter is unplugged. Before the first read any
    query counts, such as one over the control channel.

    Args:
        now_s: when the hand starts.
        reads: how often the bus was read so far.
        unplugged_s: returns the total time unplugged up to a time.
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
