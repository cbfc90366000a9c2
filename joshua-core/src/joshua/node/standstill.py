"""When this process stood still because the machine gave it no time, so that no device is blamed for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

#: How often somebody looks at the clock.
PERIOD_S = 0.02

#: A look that comes this much late says that the process was held up.
HELD_UP_S = 0.02

NS_PER_S = 1_000_000_000


class Standstills:
    """Notes when a thread that has nothing to do but to look at the clock came late.

    Args:
        clock: nanoseconds of a clock that never runs backwards.
    """

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._clock = clock
        self._looked_ns = clock()
        self._spans: list[tuple[int, int]] = []

    def look(self) -> None:
        """Looks at the clock; to be called every ``PERIOD_S``."""
        now_ns = self._clock()
        due_ns = self._looked_ns + round(PERIOD_S * NS_PER_S)
        if now_ns - due_ns > HELD_UP_S * NS_PER_S:
            self._spans.append((due_ns, now_ns))
        self._looked_ns = now_ns

    def between_ns(self, start_ns: int, end_ns: int) -> int:
        """How long the process stood still in all between two times of the clock."""
        return sum(max(0, min(end, end_ns) - max(start, start_ns)) for start, end in tuple(self._spans))

    def watch(self) -> None:
        """Looks for as long as the process lives, on a thread of its own."""

        def run() -> None:
            while True:
                time.sleep(PERIOD_S)
                self.look()

        threading.Thread(target=run, name="standstill", daemon=True).start()


_lock = threading.Lock()
_watched: list[Standstills] = []


def standstills() -> Standstills:
    """Those of this process, noted since the first call."""
    with _lock:
        if not _watched:
            _watched.append(Standstills())
            _watched[0].watch()
        return _watched[0]
