"""The one judge of silence, on a clock that counts only time in which somebody could have been heard."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

#: What one look at a clock counts at most, where it is looked at several times in each such time.
LONGEST_LOOK_S = 0.25

#: The same for those who watch a control loop; they look every 0.06 s or more often.
WATCHER_LOOK_S = 0.09

#: Silence of a loop beyond this multiple of its limit is a hang even while the loop waits for a processor.
PATIENCE_FACTOR = 5.0

#: How often the witness of a process looks; a look that comes this much late says that it was held up.
WITNESS_PERIOD_S = 0.02


class AwakeClock:
    """Seconds that pass only while somebody looks.

    A machine that gives this process no time for seconds has often given none to what it listens to, or to
    what lies between both. Once it goes on, what was said meanwhile is still on its way: that silence was
    nobody's. So a look counts the time since the look before, ``longest_look_s`` at most.

    Args:
        clock: seconds that never run backwards; longest_look_s: looks come several times in each.

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
        """Looks; the seconds that have counted so far."""
        now_s = self._clock()
        counted_s = min(now_s - self.looked_s, self._longest_look_s)
        if counted_s < now_s - self.looked_s:
            self._gaps.append((self.looked_s + counted_s, now_s))
        self._awake_s += counted_s
        self.looked_s = now_s
        return self._awake_s

    def missed_s(self, start_s: float, end_s: float) -> float:
        """How much between two times of the clock has not counted."""
        return sum(max(0.0, min(end, end_s) - max(start, start_s)) for start, end in tuple(self._gaps))


@lru_cache(maxsize=1)
def witness() -> AwakeClock:
    """A clock of this process at which a thread of its own looks from the first call on."""
    clock = AwakeClock(longest_look_s=2 * WITNESS_PERIOD_S)

    def look() -> None:
        while True:
            time.sleep(WITNESS_PERIOD_S)
            clock.now_s()

    threading.Thread(target=look, name="witness", daemon=True).start()
    return clock


class ThreadTime(NamedTuple):
    """Nanoseconds that a thread ran and waited for a processor so far; whether it does either just now."""

    ran_ns: int
    waited_ns: int
    runnable: bool


def thread_time(process_id: int, thread_id: int) -> ThreadTime | None:
    """Reads the times of a thread; None where the system does not tell.

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
    """Judges whether a control loop in another process hangs, by its signs of life.

    It hangs when it was silent for the limit, on a clock that stands still while the judge itself is held
    up, less the time in which the loop wanted to run and got no processor.

    Args:
        limit_s: silence that counts as a hang; clock: what the judge looks at, every ``WATCHER_LOOK_S``.
        loop: reads the times of the loop's thread.
    """

    def __init__(self, limit_s: float, clock: AwakeClock, loop: Callable[[], ThreadTime | None]) -> None:
        self.limit_s = limit_s
        self._clock = clock
        self._loop = loop
        self.heard()

    def heard(self) -> None:
        """A sign of life came, or the watch begins."""
        self._heard_s = self._clock.now_s()
        self._heard_at_s = self._clock.looked_s
        self._then = self._loop()

    def left_s(self) -> float:
        """How long silence may still last."""
        return self.limit_s - (self._clock.now_s() - self._heard_s)

    def silence_s(self) -> float:
        """Time since the last sign of life, whatever the reason of the silence."""
        return self._clock.looked_s - self._heard_at_s

    def hung(self) -> bool:
        """Whether the silence counts as a hang."""
        over_s = -self.left_s()
        if over_s < 0:
            return False
        return self.silence_s() >= self.limit_s * PATIENCE_FACTOR or over_s >= self._waited_s()

    def _waited_s(self) -> float:
        """Part of the silence in which the loop wanted to run and could not."""
        then, now = self._then, self._loop()
        if then is None or now is None:
            return 0.0
        if now.runnable and now.ran_ns == then.ran_ns:
            return self.silence_s()  # it still waits, which the kernel adds up only afterwards
        return (now.waited_ns - then.waited_ns) / 1e9
