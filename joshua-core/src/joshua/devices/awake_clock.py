"""Time in which this process was there to listen."""

from __future__ import annotations

import time
from collections.abc import Callable

#: What one look counts at most; drivers look more often than that while they run.
LONGEST_LOOK_S = 0.25


class AwakeClock:
    """Seconds that pass only while somebody looks; for the silence of devices, and waits for them.

    A machine that gives this process no time for seconds has often given none to what is between it and the
    device either. Once it goes on, what the device has said meanwhile is still on its way: that long silence
    was nobody's. So a look counts the time since the look before, ``LONGEST_LOOK_S`` at most.

    One thread looks, several times in each ``LONGEST_LOOK_S``.

    Args:
        clock: seconds that never run backwards.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._looked_s = clock()
        self._awake_s = 0.0

    def now_s(self) -> float:
        """Looks; the seconds that have counted so far."""
        now_s = self._clock()
        self._awake_s += min(now_s - self._looked_s, LONGEST_LOOK_S)
        self._looked_s = now_s
        return self._awake_s
