"""Estimate when the next message of a regular sender arrives, from when the earlier ones did."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import median_low

#: Number of arrivals of which the first estimate is made.
FIRST_ARRIVALS = 5

#: Number of arrivals that the estimate remembers: later ones have no smaller weight than the last of these.
MEMORY = 16

#: An arrival this far from its expected time, as a share of the interval, does not change the estimate. Of
#: two arrivals that are nearer to each other, the second was delayed.
OUTLIER = 0.4

#: The estimate starts anew when arrivals are this far from their expected times on average, as a share of the
#: interval. It is 0.25 for arrivals at random times.
WORST_FIT = 0.2

#: Number of arrivals of which that is the average.
FIT_MEMORY = 16

#: Number of messages that may be missing between two arrivals. A longer gap is a stall.
MOST_LOST = 2

#: How far the distance of two of the first arrivals may be from a whole number of intervals.
FIRST_JITTER = 0.25


class ArrivalPhase:
    """Phase and interval of messages that a sender publishes at a fixed rate.

    A straight line is fitted through the arrivals by least squares: exactly until ``MEMORY`` of them have
    come, and with constant gains from then on. Messages may be lost, and a stall delivers several at once.
    Neither moves the estimate, because each arrival counts from the nearest expected one, and only if it is
    near.

    Attributes:
        interval_ns: between two messages; 0 while it is unknown.
        phase_ns: when one of the newest messages should have arrived.

    Source: E. Brookner, Tracking and Kalman Filtering Made Easy, 1998, section 1.2.10 (expanding memory).
    """

    def __init__(self) -> None:
        self.interval_ns = 0.0
        self.phase_ns = 0.0
        self._newest: deque[int] = deque(maxlen=FIRST_ARRIVALS)
        self._count = 0
        self._misfit = 0.0

    def forget(self) -> None:
        """Start anew with the next arrival."""
        self.interval_ns = 0.0
        self._newest.clear()

    def arrived(self, now_ns: int) -> None:
        """Record the arrival of a message at a time of the monotonic clock."""
        distance_ns = now_ns - self._newest[-1] if self._newest else math.inf
        self._newest.append(now_ns)
        if not self.interval_ns:
            self._begin()
        elif distance_ns > OUTLIER * self.interval_ns:
            self._correct(now_ns)

    def nearest_ns(self, at_ns: float) -> float:
        """Return the expected arrival that is nearest to a time; the interval must be known."""
        messages = round((at_ns - self.phase_ns) / self.interval_ns)
        return self.phase_ns + messages * self.interval_ns

    def _begin(self) -> None:
        """Make the first estimate, if the newest arrivals are regular."""
        if len(self._newest) < FIRST_ARRIVALS:
            return
        arrivals_ns = tuple(self._newest)
        distances_ns = [later - earlier for earlier, later in pairwise(arrivals_ns)]
        usual_ns = median_low(distances_ns)
        if usual_ns <= 0:
            return
        regular = [distance for distance in distances_ns if _is_multiple(distance / usual_ns)]
        if len(regular) < len(distances_ns):
            return
        self.interval_ns = usual_ns
        self.phase_ns = arrivals_ns[0]
        self._count = 1
        self._misfit = 0.0
        for arrival_ns in arrivals_ns[1:]:
            self._correct(arrival_ns)

    def _correct(self, now_ns: int) -> None:
        messages = round((now_ns - self.phase_ns) / self.interval_ns)
        expected_ns = self.phase_ns + messages * self.interval_ns
        deviation_ns = now_ns - expected_ns
        if messages > 1 + MOST_LOST:  # a stall has ended, which has probably delayed this message
            self.phase_ns = expected_ns
            return
        misfit = abs(deviation_ns) / self.interval_ns
        self._misfit += (misfit - self._misfit) / FIT_MEMORY
        if self._misfit > WORST_FIT:
            self.forget()
            return
        if messages < 1 or misfit > OUTLIER:
            return
        self._count = min(self._count + 1, MEMORY)
        count = self._count
        phase_gain = 2 * (2 * count - 1) / (count * (count + 1))
        interval_gain = 6 / (count * (count + 1))
        self.phase_ns = expected_ns + phase_gain * deviation_ns
        self.interval_ns += interval_gain * deviation_ns / messages


def _is_multiple(intervals: float) -> bool:
    """Whether a distance of so many intervals is one or a few of them, up to the jitter of an arrival."""
    messages = round(intervals)
    return 1 <= messages <= 1 + MOST_LOST and abs(intervals - messages) <= FIRST_JITTER
