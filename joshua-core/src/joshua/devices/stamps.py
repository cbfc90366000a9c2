"""Acquisition stamps: time since the epoch that never runs backwards."""

from __future__ import annotations

import time

from joshua.node import ros_time

NS_PER_S = 1_000_000_000


class StampClock:
    """Gives stamps in ns since the epoch, each later than the one before even when the clock is set back.

    They advance with the monotonic clock, follow the machine's clock when it is set forward, and run ahead
    of it when it is set back, so that the distance of two stamps stays true.
    """

    def __init__(self) -> None:
        self._offset_ns = self._last_ns = 0

    def now_ns(self) -> int:
        """The stamp of an acquisition at this moment, in simulated time if the node follows it."""
        if ros_time.is_simulated():
            simulated_ns = ros_time.now_ns()
            # a reset of the simulation sets its time back
            self._last_ns = simulated_ns if simulated_ns < self._last_ns - NS_PER_S else self._last_ns
            self._last_ns = max(simulated_ns, self._last_ns + 1)
            return self._last_ns
        # The order matters. A delay between the two makes the offset too small, which the next call corrects.
        # In the other order it would stay too large, and every later stamp would lie in the future.
        wall_ns = time.time_ns()
        monotonic_ns = time.monotonic_ns()
        self._offset_ns = max(self._offset_ns, wall_ns - monotonic_ns)
        self._last_ns = max(monotonic_ns + self._offset_ns, self._last_ns + 1)
        return self._last_ns
