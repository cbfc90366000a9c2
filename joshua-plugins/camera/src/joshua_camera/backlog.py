"""Tell fresh pictures from those that waited in a buffer.

A network stream contains no acquisition time. After a stall of the reader or the network, buffers hold old
pictures that then arrive without any wait. Their time of arrival would be a wrong stamp.
"""

from __future__ import annotations

import statistics
from collections import deque

_NS_PER_S = 1_000_000_000
_WINDOW = 5
_HELD_UP_PERIODS = 3.0

#: Shorter gaps are system jitter.
LEAST_GAP_NS = 50_000_000

#: A picture that the reader waited this long for was not in a buffer.
LEAST_WAIT_NS = 2_000_000

#: No buffer takes longer to drain; a source that sends bursts must not be rejected indefinitely.
LONGEST_DRAIN_NS = 1_000_000_000


class Backlog:
    """Judges each picture of a live stream by how long the reader waited for it.

    After opening, after a pause of three usual intervals, and after a period without a reader, pictures count
    as old until the reader has waited at least half the usual interval for one. The usual interval is the
    median of the last intervals between pictures that the reader had to wait for.

    Args:
        fps: initially expected frames per second.
    """

    def __init__(self, fps: float) -> None:
        self._nominal_ns = _NS_PER_S / fps
        self._distances_ns: deque[int] = deque(maxlen=_WINDOW)
        self._last_ns: int | None = None
        self._last_waited_ns: int | None = None
        self._draining_since_ns: int | None = None

    def is_fresh(self, began_ns: int, ended_ns: int, slept_ns: int) -> bool:
        """Return whether a picture is fresh.

        Args:
            began_ns: when the reader started to wait, monotonic clock.
            ended_ns: when the picture arrived.
            slept_ns: how long the reader slept in between.
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
            # no reader waited for it, so its arrival time is unknown
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
