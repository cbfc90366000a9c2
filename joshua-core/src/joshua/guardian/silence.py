"""Hangs and silent devices, on a clock that leaves out time in which the watcher itself could not run."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

#: Upper limit of the time that one look counts, for a clock that is read several times in that time.
LONGEST_LOOK_S = 0.25

#: The same for watchers of a control loop, which look at least every 0.06 s.
WATCHER_LOOK_S = 0.09

#: A loop without heartbeat for this multiple of its limit hangs, even while it waits for a processor.
PATIENCE_FACTOR = 5.0

#: Interval at which the witness of a process reads the clock.
WITNESS_PERIOD_S = 0.02


class AwakeClock:
    """A clock that advances at most ``longest_look_s`` per look.

    A machine that stalls this process for seconds has often stalled the watched one too, and its messages
    arrive only afterwards. That time does not count.

    Args:
        clock: monotonic seconds; longest_look_s: looks come several times in each.

    Attributes:
        looked_s: the clock's time of the last look.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, longest_look_s: float = LONGEST_LOOK_S
    ) -> None:
        self._clock = clock
        self._longest_look_s = longest_look_s
        self.looked_s = clock()
        self._awake_s = 0.0
        self._gaps: deque[tuple[float, float]] = deque(maxlen=10_000)

    def now_s(self) -> float:
        """Looks and returns the seconds counted so far."""
        now_s = self._clock()
        counted_s = min(now_s - self.looked_s, self._longest_look_s)
        if counted_s < now_s - self.looked_s:
            self._gaps.append((self.looked_s + counted_s, now_s))
        self._awake_s += counted_s
        self.looked_s = now_s
        return self._awake_s

    def missed_s(self, start_s: float, end_s: float) -> float:
        """Time between two times of the clock that was not counted."""
        return sum(max(0.0, min(end, end_s) - max(start, start_s)) for start, end in tuple(self._gaps))


@lru_cache(maxsize=1)
def witness() -> AwakeClock:
    """A clock of this process with a thread that looks at it, started by the first call."""
    clock = AwakeClock(longest_look_s=2 * WITNESS_PERIOD_S)

    def look() -> None:
        while True:
            time.sleep(WITNESS_PERIOD_S)
            clock.now_s()

    threading.Thread(target=look, name="witness", daemon=True).start()
    return clock


class ThreadTime(NamedTuple):
    """Nanoseconds that a thread ran and waited for a processor, and whether it does either now."""

    ran_ns: int
    waited_ns: int
    runnable: bool


def thread_time(process_id: int, thread_id: int) -> ThreadTime | None:
    """Reads the times of a thread, None if the system has none.

    Source: Documentation/scheduler/sched-stats.rst, first two fields of ``schedstat``.
    """
    task = Path(f"/proc/{process_id}/task/{thread_id}")
    try:
        ran, waited, _ = (task / "schedstat").read_text().split()
        state = (task / "stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, ValueError, IndexError):
        return None
    return ThreadTime(int(ran), int(waited), state == "R")


class SilenceJudge:
    """Decides from heartbeats whether a control loop in another process hangs.

    It hangs if no heartbeat came for the limit, not counting time in which the watcher could not run or the
    loop waited for a processor.

    Args:
        limit_s: time without heartbeat that counts as a hang.
        clock: of the watcher, which looks at least every ``WATCHER_LOOK_S``.
        loop: reads the times of the loop's thread.
    """

    def __init__(self, limit_s: float, clock: AwakeClock, loop: Callable[[], ThreadTime | None]) -> None:
        self.limit_s = limit_s
        self._clock = clock
        self._loop = loop
        self.heard()

    def heard(self) -> None:
        """A heartbeat came, or the watch begins."""
        self._heard_s = self._clock.now_s()
        self._heard_at_s = self._clock.looked_s
        self._then = self._loop()
        self._ran_ns: int | None = None  # by the last look after the limit

    def left_s(self) -> float:
        """Time left until the limit."""
        return self.limit_s - (self._clock.now_s() - self._heard_s)

    def silence_s(self) -> float:
        """Wall time since the last heartbeat."""
        return self._clock.looked_s - self._heard_at_s

    def hung(self) -> bool:
        """Whether the loop hangs."""
        over_s = -self.left_s()
        if over_s < 0:
            return False
        return self.silence_s() >= self.limit_s * PATIENCE_FACTOR or over_s >= self._waited_s()

    def _waited_s(self) -> float:
        """Time since the last heartbeat in which the loop waited for a processor."""
        then, now = self._then, self._loop()
        if then is None or now is None:
            return 0.0
        ran_ns, self._ran_ns = self._ran_ns, now.ran_ns
        if now.runnable and ran_ns in (None, now.ran_ns):
            return self.silence_s()  # still waiting, which the kernel adds up only afterwards
        return (now.waited_ns - then.waited_ns) / 1e9


#: A device that leaves its requests unanswered for this long is silent. A USB hub that re-enumerates delays
#: every reply by 0.1 to 0.2 s. Nothing is written meanwhile, so the joints stay at their last goal.
SILENCE_LIMIT_S = 0.4

#: A request without a reply counts for at most this share of the limit, however long it takes.
LEAST_MISSES = 5


def waited_s() -> float:
    """Seconds for which this thread waited for a processor so far; 0 if the system does not tell."""
    times = thread_time(os.getpid(), threading.get_native_id())
    return 0.0 if times is None else times.waited_ns / 1e9


class Patience:
    """How long a device may leave requests unanswered: the same from its start to its safe stop.

    A gap begins with the first request without a reply. It counts awake time only: neither time in which
    this process stood still nor time in which this thread waited for a processor. A device is silent when
    that reaches the limit. A gap of ``PATIENCE_FACTOR`` times the limit with ``LEAST_MISSES`` ends the
    patience, too, but proves nothing about the device.

    Args:
        limit_s: awake time without a reply.
        period_s: planned distance of two requests; a longer one counts as this or as a share of the limit.
        clock: monotonic seconds; waited: seconds for which this thread waited for a processor.

    Attributes:
        misses: requests without a reply in the present gap.
        awake_s, gap_s: from its first request to its last miss, awake and in all.
    """

    def __init__(
        self,
        limit_s: float = SILENCE_LIMIT_S,
        *,
        period_s: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
        waited: Callable[[], float] = waited_s,
    ) -> None:
        self.limit_s = limit_s
        self.misses = 0
        self.awake_s = self.gap_s = 0.0
        self._clock = clock
        self._waited = waited
        self._most_s = max(limit_s / LEAST_MISSES, period_s)
        self._began_s = self._missed_s = 0.0
        self._waited_s = 0.0  # of the thread, at the last miss

    def begin(self) -> None:
        """A request is about to be sent."""
        if not self.misses:
            self._began_s = self._missed_s = self._clock()
            self.awake_s = self.gap_s = 0.0

    def miss(self) -> bool:
        """It got no reply. Returns whether that is still tolerated."""
        self.misses += 1
        now_s, waited_s = self._clock(), self._waited()
        elapsed_s = now_s - self._missed_s
        if self.misses > 1:
            elapsed_s -= waited_s - self._waited_s
        self.awake_s += max(0.0, min(elapsed_s, self._most_s))
        self.gap_s = now_s - self._began_s
        self._missed_s, self._waited_s = now_s, waited_s
        is_over = self.misses >= LEAST_MISSES and self.gap_s >= self.limit_s * PATIENCE_FACTOR
        return not self.is_silent and not is_over

    def hear(self) -> float:
        """It got one. Returns the length of the gap that ends, 0 if there was none."""
        if not self.misses:
            return 0.0
        self.misses = 0
        return self._clock() - self._began_s

    @property
    def left_s(self) -> float:
        """Awake time that is left."""
        return self.limit_s - self.awake_s

    @property
    def is_silent(self) -> bool:
        """Whether the device left its requests unanswered for the limit."""
        return self.misses > 0 and self.awake_s >= self.limit_s

    @property
    def delayed_s(self) -> float:
        """Time of the gap that does not count, because this process was delayed."""
        return self.gap_s - self.awake_s
