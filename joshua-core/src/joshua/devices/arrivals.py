"""Keeps a control cycle in phase with the commands that it executes, so that each is written on arrival."""

from __future__ import annotations

import math
import threading
import time

from joshua.devices.arrival_phase import ArrivalPhase
from joshua.node.timers import Timer

NS_PER_S = 1_000_000_000

#: The cycle follows arrivals if their interval, or a whole multiple of it, is this close to its own period.
_FOLLOWS = 0.08

#: A reading should be complete this long before the command is expected.
_MARGIN_NS = 500_000

#: A cycle begins at most this share of its period before the command. The rest is for its write.
_LONGEST_LEAD = 0.75

#: Longest wait for a command that is late, as a share of the interval.
_LATE = 0.4

#: Number of intervals or periods without a command after which there is nothing to follow.
_LOST = 3


class Arrivals:
    """The commands of one actuator as they arrive, and the control cycle that follows them.

    A cycle reads its device, then writes a goal. In phase, it begins so that the reading is complete just
    before the next command is expected, waits for that command, and writes it immediately. Protections are
    therefore still read directly before each write. Without regular arrivals, the cycle keeps its own clock.

    Each cycle selects the command that it waits for by the time at which it begins. After a stall it
    therefore goes on with the next command: what the stall skipped is counted once by the timer. No cycle
    begins less than half a period after the last one.

    Args:
        period_s: of the control cycle on its own clock.
    """

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * NS_PER_S)
        self._condition = threading.Condition()
        self._phase = ArrivalPhase()
        self._last_ns = 0
        self._began_ns = 0
        self._reading_ns = 0.0  # how long a reading takes: its maximum, which decays slowly

    def arrived(self, now_ns: int) -> None:
        """Records the arrival of a command, on a transport thread; ``now_ns`` on the monotonic clock."""
        with self._condition:
            self._phase.arrived(now_ns)
            self._last_ns = now_ns
            self._condition.notify_all()

    def begin(self) -> None:
        """A control cycle begins."""
        self._began_ns = time.monotonic_ns()

    def wait(self) -> None:
        """The reading is complete: waits for the command of this cycle, if the cycle is in phase."""
        took_ns = time.monotonic_ns() - self._began_ns
        lead_ns = self._lead_ns
        if took_ns < self._period_ns:  # otherwise the machine stalled, which says nothing about the device
            self._reading_ns = max(took_ns, self._reading_ns + 0.02 * (took_ns - self._reading_ns))
        with self._condition:
            if not self._follows():
                return
            interval_ns = self._phase.interval_ns
            expected_ns = self._phase.nearest_ns(self._began_ns + lead_ns)
            earliest_ns = expected_ns - interval_ns / 2
            latest_ns = expected_ns + _LATE * interval_ns
            while self._last_ns < earliest_ns and (left_ns := latest_ns - time.monotonic_ns()) > 0:
                self._condition.wait(left_ns / NS_PER_S)

    def end(self, timer: Timer) -> None:
        """The goal is written: schedules the next cycle. No effect on a timer that does not run."""
        planned_ns = timer.deadline_ns
        if planned_ns is None:
            return
        timer.wait_until(self._began_ns + self._period_ns // 2)
        with self._condition:
            if not self._follows():
                return
            lead_ns = self._lead_ns
            next_ns = self._phase.nearest_ns(planned_ns + lead_ns) - lead_ns
        timer.schedule(round(next_ns))

    @property
    def _lead_ns(self) -> float:
        """How long before its command a cycle begins."""
        return min(self._reading_ns + _MARGIN_NS, _LONGEST_LEAD * self._period_ns)

    def _follows(self) -> bool:
        """Whether commands arrive at the rate of the cycle, or at a multiple of it."""
        interval_ns = self._phase.interval_ns
        if not interval_ns:
            return False
        if time.monotonic_ns() - self._last_ns > _LOST * max(interval_ns, self._period_ns):
            self._phase.forget()
            return False
        messages = max(1, math.ceil((1 - _FOLLOWS) * self._period_ns / interval_ns))
        return messages * interval_ns <= (1 + _FOLLOWS) * self._period_ns
