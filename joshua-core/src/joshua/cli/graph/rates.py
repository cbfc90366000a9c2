"""How often messages arrive, over a window of the latest ones."""

from __future__ import annotations

import itertools
import statistics
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """Figures of one window; periods in seconds."""

    rate_hz: float
    shortest_s: float
    longest_s: float
    deviation_s: float
    count: int

    def __str__(self) -> str:
        return (
            f"{self.rate_hz:.2f} Hz  period {self.shortest_s * 1e3:.1f} to {self.longest_s * 1e3:.1f} ms  "
            f"deviation {self.deviation_s * 1e3:.2f} ms  messages {self.count}"
        )


class RateMeter:
    """Collects arrival times.

    Args:
        window: messages that count, at most.
    """

    def __init__(self, window: int) -> None:
        self._arrivals_s: deque[float] = deque(maxlen=window)

    def arrived(self, time_s: float) -> None:
        """Takes in one arrival on the monotonic clock."""
        self._arrivals_s.append(time_s)

    def rate(self) -> Rate | None:
        """The figures; None with fewer than two arrivals."""
        times_s = list(self._arrivals_s)
        if len(times_s) < 2:
            return None
        periods_s = [later - sooner for sooner, later in itertools.pairwise(times_s)]
        span_s = times_s[-1] - times_s[0]
        return Rate(
            rate_hz=len(periods_s) / span_s if span_s else float("inf"),
            shortest_s=min(periods_s),
            longest_s=max(periods_s),
            deviation_s=statistics.pstdev(periods_s),
            count=len(times_s),
        )
