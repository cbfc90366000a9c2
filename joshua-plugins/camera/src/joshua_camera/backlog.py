"""Tells pictures that were taken just now from those that waited in a buffer.

A network stream contains no acquisition time. When the reader or the network was stalled, the buffers hold
old pictures, which then come without any wait; stamped with the time of their arrival they would lie.
"""

from __future__ import annotations

import statistics
from collections import deque

_NS_PER_S = 1_000_000_000
_WINDOW = 5
_HELD_UP_PERIODS = 3.0

#: Shorter gaps are the jitter of the system.
LEAST_GAP_NS = 50_000_000

#: A picture for which the reader slept this long was not in a buffer.
LEAST_WAIT_NS = 2_000_000

#: No buffer takes longer to empty; a source that comes in bursts must not be shut out indefinitely.
LONGEST_DRAIN_NS = 1_000_000_000


class Backlog:
    """Judges each picture of a live stream by how long the reader slept for it.

    After the opening, after a pause of three usual distances, and after one in which nobody waited, pictures
    are old until one comes that was waited for at least half the usual distance. That distance is the median
    of the last ones between pictures that had to be waited for.

    Args:
        fps: frames per second that are expected at first.
    """

    def __init__(self, fps: float) -> None:
        self._nominal_ns = _NS_PER_S / fps
        self._distances_ns: deque[int] = deque(maxlen=_WINDOW)
        self._last_ns: int | None = None
        self._last_waited_ns: int | None = None
        self._draining_since_ns: int | None = None

    def is_fresh(self, began_ns: int, ended_ns: int, slept_ns: int) -> bool:
        """Whether a picture is new.

        Args:
            began_ns: when the reader asked for it, monotonic clock.
            ended_ns: when it was there.
            slept_ns: how much of the time between the reader slept.
        """
        last_ns, self._last_ns = self._last_ns, ended_ns
        usual_ns = self._usual_ns()
        self._learn(ended_ns, slept_ns)
        if last_ns is None:
            self._draining_since_ns = began_ns
        elif ended_ns - last_ns > max(_HELD_UP_PERIODS * max(usual_ns, self._nominal_ns), LEAST_GAP_NS):
            self._draining_since_ns = ended_ns
            return False
        elif began_ns - last_ns > max(usual_ns, LEAST_WAIT_NS):
            # nobody waited when it came, so nobody knows when that was
            self._draining_since_ns = ended_ns
        if self._draining_since_ns is not None and (
            slept_ns >= usual_ns / 2 or ended_ns - self._draining_since_ns > LONGEST_DRAIN_NS
        ):
            self._draining_since_ns = None
        return self._draining_since_ns is None

    def _learn(self, ended_ns: int, slept_ns: int) -> None:
        if slept_ns < LEAST_WAIT_NS:
            return
        if self._last_waited_ns is not None:
            self._distances_ns.append(ended_ns - self._last_waited_ns)
        self._last_waited_ns = ended_ns

    def _usual_ns(self) -> float:
        if len(self._distances_ns) < _WINDOW // 2 + 1:
            return self._nominal_ns
        return statistics.median(self._distances_ns)
