"""When each byte of a stream was on the line."""

from __future__ import annotations

from collections import deque

import numpy as np
from joshua.devices.serial_port import BITS_PER_BYTE

from joshua_lidar.samples import Offsets

_NS_PER_S = 1_000_000_000
_KEPT = 4096  # pieces; packets that are held back must still find theirs


class Arrivals:
    """Remembers when pieces of the stream came; a byte left the line as long before as those behind it took.

    Args:
        baudrate: of the line, with ten bits a byte.
    """

    def __init__(self, baudrate: int) -> None:
        self._byte_ns = BITS_PER_BYTE * _NS_PER_S / baudrate
        self._ends: deque[int] = deque(maxlen=_KEPT)
        self._times_ns: deque[int] = deque(maxlen=_KEPT)
        self._received = 0

    def add(self, size: int, now_ns: int) -> None:
        """Notes that a piece of some bytes came now."""
        self._received += size
        self._ends.append(self._received)
        self._times_ns.append(now_ns)

    def times_ns(self, end: Offsets) -> Offsets:
        """When the last bytes of packets were on the line, by their places in the stream."""
        pieces, times = np.array(self._ends), np.array(self._times_ns)
        piece = np.minimum(np.searchsorted(pieces, end), len(pieces) - 1)
        behind_ns = (pieces[piece] - end) * self._byte_ns
        result: Offsets = times[piece] - behind_ns.astype(np.int64)
        return result

    def forget(self, before: int) -> None:
        """Forgets pieces that end before a place of the stream."""
        while len(self._ends) > 1 and self._ends[0] < before:
            self._ends.popleft()
            self._times_ns.popleft()
