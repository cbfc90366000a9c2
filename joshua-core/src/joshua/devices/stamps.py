"""Acquisition stamps: time of the epoch that never runs backwards."""

from __future__ import annotations

import time


class StampClock:
    """Gives stamps in ns since the epoch, each later than the one before even when the clock is set back.

    They advance with the monotonic clock, follow the machine's clock when it is set forward, and run ahead
    of it when it is set back, so that the distance of two stamps stays true.
    """

    def __init__(self) -> None:
        self._offset_ns = self._last_ns = 0

    def now_ns(self) -> int:
        """The stamp of an acquisition that happens now."""
        monotonic_ns = time.monotonic_ns()
        self._offset_ns = max(self._offset_ns, time.time_ns() - monotonic_ns)
        self._last_ns = max(monotonic_ns + self._offset_ns, self._last_ns + 1)
        return self._last_ns
