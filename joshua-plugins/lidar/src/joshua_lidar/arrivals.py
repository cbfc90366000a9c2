"""Estimate of when each byte of a stream was on the line."""

from __future__ import annotations

from collections import deque

import numpy as np
from joshua_serial.port import BITS_PER_BYTE

from joshua_lidar.samples import Offsets

_NS_PER_S = 1_000_000_000
_KEPT = 4096  # chunks; packets that are held back still need theirs

#: Shortest and longest window in which the usual rate of a line is measured.
_USUAL_FROM_NS = 500_000_000
_USUAL_OVER_NS = 2_000_000_000

#: A pause in which less than half the usual bytes arrive was caused by the sender.
_PAUSE_NS = 250_000_000


class Arrivals:
    """Records when chunks of the stream arrived and dates each byte back by the bytes after it.

    A chunk is what arrived since the last read: a few packets with pauses between them, or many that had to
    wait for the reader. Its bytes are assumed to arrive at the usual rate of the stream once that is known,
    and at the line rate before.

    Args:
        baudrate: of the line, with ten bits per byte.
    """

    def __init__(self, baudrate: int) -> None:
        self._byte_ns = BITS_PER_BYTE * _NS_PER_S / baudrate
        self._ends: deque[int] = deque(maxlen=_KEPT)
        self._times_ns: deque[int] = deque(maxlen=_KEPT)
        self._paces_ns: deque[float] = deque(maxlen=_KEPT)
        self._received = 0
        self._last_ns = 0
        self._pace_ns = self._byte_ns  # as known before the marks
        self._marks: deque[tuple[int, int]] = deque()  # byte counts and times for measuring the usual rate

    def add(self, size: int, now_ns: int) -> None:
        """Record that a chunk arrived now."""
        if not size:
            return
        pause_ns = now_ns - self._last_ns
        if pause_ns > _PAUSE_NS and 2 * size * self._usual_ns(self._last_ns) < pause_ns:
            self._pace_ns = self._usual_ns(self._last_ns)  # until a new rate is measured
            self._marks.clear()
        self._last_ns = now_ns
        self._received += size
        self._ends.append(self._received)
        self._times_ns.append(now_ns)
        self._paces_ns.append(self._usual_ns(now_ns))
        if not self._marks or now_ns - self._marks[-1][1] >= _USUAL_FROM_NS:
            self._marks.append((self._received, now_ns))
        while len(self._marks) > 1 and now_ns - self._marks[1][1] >= _USUAL_OVER_NS:
            self._marks.popleft()

    def _usual_ns(self, now_ns: int) -> float:
        """Return the average time per byte, as far as it is known."""
        count, since_ns = self._marks[0] if self._marks else (0, now_ns)
        if now_ns - since_ns < _USUAL_FROM_NS or self._received <= count:
            return self._pace_ns
        return max(self._byte_ns, (now_ns - since_ns) / (self._received - count))

    def times_ns(self, end: Offsets) -> Offsets:
        """Return when the bytes at stream offsets were on the line."""
        pieces, times = np.array(self._ends), np.array(self._times_ns)
        piece = np.minimum(np.searchsorted(pieces, end), len(pieces) - 1)
        behind_ns = (pieces[piece] - end) * np.array(self._paces_ns)[piece]
        result: Offsets = times[piece] - behind_ns.astype(np.int64)
        return result

    def forget(self, before: int) -> None:
        """Forget chunks that end before a stream offset."""
        while len(self._ends) > 1 and self._ends[0] < before:
            self._ends.popleft()
            self._times_ns.popleft()
            self._paces_ns.popleft()
