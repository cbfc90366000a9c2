"""How long a device that does not answer is waited for before its node fails."""

from __future__ import annotations

import os
from collections.abc import Callable

#: A machine that gives nobody its time, or a hub that settles, keeps every reply back for a tenth of a second
#: or two. Nothing is written meanwhile, so the joints stay at their last goal.
SILENCE_LIMIT_S = 0.4

#: A machine that holds the device up may hold its driver up, too: so many readings are tried at least …
LEAST_MISSES = 5
#: … within this time, which counts as well while the machine has more to do than it can.
LONGEST_SILENCE_S = 1.0


def machine_is_busy() -> bool:
    """Whether more threads want a processor than there are, over the last minute."""
    return os.getloadavg()[0] > (os.cpu_count() or 1)


class Patience:
    """Judges readings that did not come; one for each actuator.

    Args:
        busy: whether the machine is.

    Attributes:
        missed: readings that did not come so far; longest_s: the longest silence of those that ended.
    """

    def __init__(
        self, limit_s: float = SILENCE_LIMIT_S, *, busy: Callable[[], bool] = machine_is_busy
    ) -> None:
        self._limit_s = limit_s
        self._busy = busy
        self._since_s: float | None = None
        self._misses = 0
        self.missed = 0
        self.longest_s = 0.0

    def miss(self, began_s: float, now_s: float) -> bool:
        """Counts a reading that was begun and did not come; returns whether that is still bearable."""
        self.missed += 1
        if self._since_s is None:
            self._since_s, self._misses = began_s, 0
        self._misses += 1
        silence_s = now_s - self._since_s
        if silence_s < self._limit_s:
            return True
        return silence_s < LONGEST_SILENCE_S and (self._misses < LEAST_MISSES or self._busy())

    def hear(self, now_s: float) -> float:
        """A reading came; returns how long the silence was that it ends, 0 where there was none."""
        if self._since_s is None:
            return 0.0
        silence_s, self._since_s = now_s - self._since_s, None
        self.longest_s = max(self.longest_s, silence_s)
        return silence_s
