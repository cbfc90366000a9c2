"""A single-threaded event loop: descriptors and timers, nothing else."""

from __future__ import annotations

import heapq
import itertools
import selectors
import time
from collections import deque
from collections.abc import Callable


class ReactorTimer:
    """A callback at a time; ``cancel`` takes it back."""

    def __init__(self, due_s: float, callback: Callable[[], None]) -> None:
        self.due_s = due_s
        self.callback: Callable[[], None] | None = callback

    def cancel(self) -> None:
        """Makes sure that the callback does not run; a second call does nothing."""
        self.callback = None


class Reactor:
    """Calls back for readable and writable descriptors and for timers.

    Descriptors come first in each turn, so that a timer which judges silence has heard everything that
    was said before.

    Args:
        clock: seconds of a clock that never goes back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._timers: list[tuple[float, int, ReactorTimer]] = []
        self._order = itertools.count()

    def now_s(self) -> float:
        """The loop's clock."""
        return self._clock()

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> ReactorTimer:
        """Calls back once after a delay."""
        timer = ReactorTimer(self._clock() + max(0.0, delay_s), callback)
        heapq.heappush(self._timers, (timer.due_s, next(self._order), timer))
        return timer

    def watch(
        self,
        descriptor: int,
        on_readable: Callable[[], object],
        on_writable: Callable[[], object] | None = None,
    ) -> None:
        """Calls back when a descriptor is readable or, if asked for, writable; replaces a former watch."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if on_writable else 0)
        data = (on_readable, on_writable)
        if descriptor in self._selector.get_map():
            self._selector.modify(descriptor, events, data)
        else:
            self._selector.register(descriptor, events, data)

    def forget(self, descriptor: int) -> None:
        """Stops watching a descriptor; an unknown one is no error."""
        if descriptor in self._selector.get_map():
            self._selector.unregister(descriptor)

    def turn(self) -> None:
        """Waits for the next event and handles what is due."""
        ready = self._selector.select(self._next_timeout_s())
        for key, events in ready:
            current = self._selector.get_map().get(key.fd)
            if current is None or current.data is not key.data:
                continue  # an earlier callback of this turn has closed or changed it
            on_readable, on_writable = key.data
            if events & selectors.EVENT_WRITE and on_writable is not None:
                on_writable()
            if events & selectors.EVENT_READ:
                on_readable()
        self._run_timers()

    def close(self) -> None:
        """Forgets everything; a second call does nothing."""
        self._timers.clear()
        self._selector.close()

    def _next_timeout_s(self) -> float | None:
        while self._timers and self._timers[0][2].callback is None:
            heapq.heappop(self._timers)
        return max(0.0, self._timers[0][0] - self._clock()) if self._timers else None

    def _run_timers(self) -> None:
        now_s = self._clock()
        due: deque[tuple[float, int, ReactorTimer]] = deque()
        while self._timers and self._timers[0][0] <= now_s:
            due.append(heapq.heappop(self._timers))
        try:
            while due:
                timer = due.popleft()[2]
                callback, timer.callback = timer.callback, None
                if callback is not None:
                    callback()
        finally:
            for entry in due:  # one has raised: the others keep their turn, for among them may be a ladder's
                heapq.heappush(self._timers, entry)
