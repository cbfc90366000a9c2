"""Acquisition stamps: time of the epoch that never runs backwards."""

from __future__ import annotations

import time


class StampClock:
    """Gives stamps in ns since the epoch, each later than the one before even when the clock is set back."""

    def __init__(self) -> None:
        self._last_ns = 0

    def now_ns(self) -> int:
        """The stamp of an acquisition that happens now."""
        self._last_ns = max(time.time_ns(), self._last_ns + 1)
        return self._last_ns
