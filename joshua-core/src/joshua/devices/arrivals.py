"""Keeps a control cycle in phase with the commands that it executes, so that each is written on arrival."""

from __future__ import annotations

import math
import threading
import time

from joshua.node.timers import Timer

NS_PER_S = 1_000_000_000

#: Number of arrivals whose mean distance is the first estimate of their interval.
_FIRST_ARRIVALS = 10

#: Share of a deviation that corrects the expected time, and the interval, of the next arrival.
_PHASE_GAIN, _INTERVAL_GAIN = 0.1, 0.005

#: The cycle follows arrivals if their interval, or a whole multiple of it, is this close to its own period.
_FOLLOWS = 0.08

#: A reading should be complete this long before the command is expected.
_MARGIN_NS = 500_000

#: A cycle begins at most this share of its period before the command. The rest is for its write.
_LONGEST_LEAD = 0.75

#: Longest wait for a command that is late, as a share of the interval.
_LATE = 0.4


class Arrivals:
    """The commands of one actuator as they arrive, and the control cycle that follows them.

    A cycle reads its device, then writes a goal. In phase, it begins so that the reading is complete just
    before the next command is expected, waits for that command, and writes it immediately. Protections are
    therefore still read directly before each write. Without regular arrivals, the cycle keeps its own clock.

    Args:
        period_s: of the control cycle on its own clock.
    """

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * NS_PER_S)
        self._condition = threading.Condition()
        self._times: list[int] = []
        self._interval_ns = 0.0
        self._phase_ns = 0.0  # when the newest command should have arrived
        self._last_ns = 0
        self._began_ns = 0
        self._lead_ns = 0.0
        self._expected_ns: float | None = None

    def arrived(self, now_ns: int) -> None:
        """Records the arrival of a command, on a transport thread; ``now_ns`` on the monotonic clock."""
        with self._condition:
            if self._interval_ns:
                count = round((now_ns - self._phase_ns) / self._interval_ns)
                expected_ns = self._phase_ns + count * self._interval_ns
                deviation_ns = now_ns - expected_ns
                self._phase_ns = expected_ns + _PHASE_GAIN * deviation_ns
                self._interval_ns += _INTERVAL_GAIN * deviation_ns / max(count, 1)
            else:
                self._times.append(now_ns)
                if len(self._times) == _FIRST_ARRIVALS:
                    self._interval_ns = max(1.0, (now_ns - self._times[0]) / (_FIRST_ARRIVALS - 1))
                    self._phase_ns = now_ns
            self._last_ns = now_ns
            self._condition.notify_all()

    def begin(self) -> None:
        """A control cycle begins."""
        self._began_ns = time.monotonic_ns()

    def wait(self) -> None:
        """The reading is complete: waits for the command of this cycle, if the cycle is in phase."""
        now_ns = time.monotonic_ns()
        took_ns = now_ns - self._began_ns
        self._lead_ns = max(took_ns, self._lead_ns + 0.02 * (took_ns - self._lead_ns))
        if self._expected_ns is None:
            return
        with self._condition:
            latest_ns = self._expected_ns + _LATE * self._interval_ns
            earliest_ns = self._expected_ns - self._interval_ns / 2
            while self._last_ns < earliest_ns and (left_ns := latest_ns - time.monotonic_ns()) > 0:
                self._condition.wait(left_ns / NS_PER_S)

    def end(self, timer: Timer) -> None:
        """The goal is written: schedules the next cycle, if the cycle is in phase."""
        with self._condition:
            reference_ns = self._expected_ns or self._began_ns + self._lead_ns
            self._expected_ns = self._expect(reference_ns + self._period_ns)
            if self._expected_ns is not None:
                lead_ns = min(self._lead_ns + _MARGIN_NS, _LONGEST_LEAD * self._period_ns)
                timer.schedule(round(self._expected_ns - lead_ns))

    def _expect(self, at_ns: float) -> float | None:
        """The expected arrival nearest to a time; None if arrivals stopped, or come at another rate."""
        if not self._interval_ns:
            return None
        if time.monotonic_ns() - self._last_ns > 3 * max(self._interval_ns, self._period_ns):
            self._interval_ns, self._times = 0.0, []
            return None
        count = max(1, math.ceil((1 - _FOLLOWS) * self._period_ns / self._interval_ns))
        if count * self._interval_ns > (1 + _FOLLOWS) * self._period_ns:
            return None
        return self._phase_ns + round((at_ns - self._phase_ns) / self._interval_ns) * self._interval_ns
