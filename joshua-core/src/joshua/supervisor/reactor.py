"""A single-threaded event loop: descriptors, timers, signals, and calls from other threads."""

from __future__ import annotations

import contextlib
import heapq
import itertools
import os
import selectors
import signal
import time
from collections import deque
from collections.abc import Callable
from typing import Any


class ReactorTimer:
    """A callback at a time, until it is cancelled."""

    def __init__(self, due_s: float, callback: Callable[[], None]) -> None:
        self.due_s = due_s
        self.callback: Callable[[], None] | None = callback

    def cancel(self) -> None:
        """Prevents the callback. Idempotent."""
        self.callback = None


class Reactor:
    """Calls back for readable and writable descriptors and for timers.

    Descriptors come first in each turn: a timer that checks for a hang must have every received heartbeat.

    Args:
        clock: monotonic seconds.

    Attributes:
        wake_descriptor: a byte written to it wakes the loop, for ``signal.set_wakeup_fd``.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._timers: list[tuple[float, int, ReactorTimer]] = []
        self._order = itertools.count()
        self._posted: deque[Callable[[], None]] = deque()
        self._wake_receiver, self.wake_descriptor = os.pipe()
        os.set_blocking(self._wake_receiver, False)
        os.set_blocking(self.wake_descriptor, False)
        self.watch(self._wake_receiver, self.run_posted)

    def now_s(self) -> float:
        """The loop's clock."""
        return self._clock()

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> ReactorTimer:
        """Calls back once after a delay."""
        timer = ReactorTimer(self._clock() + max(0.0, delay_s), callback)
        heapq.heappush(self._timers, (timer.due_s, next(self._order), timer))
        return timer

    def post(self, callback: Callable[[], None]) -> None:
        """Calls back soon on the loop's thread. Other threads and signal handlers may call this."""
        self._posted.append(callback)
        with contextlib.suppress(OSError):  # full, so the loop wakes anyway
            os.write(self.wake_descriptor, b"\0")

    def run_posted(self) -> None:
        """Runs what was posted."""
        with contextlib.suppress(BlockingIOError):
            os.read(self._wake_receiver, 4096)
        while self._posted:
            self._posted.popleft()()

    def watch(
        self,
        descriptor: int,
        on_readable: Callable[[], object],
        on_writable: Callable[[], object] | None = None,
    ) -> None:
        """Calls back when a descriptor is readable or, if requested, writable. Replaces a former watch."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if on_writable else 0)
        data = (on_readable, on_writable)
        if descriptor in self._selector.get_map():
            self._selector.modify(descriptor, events, data)
        else:
            self._selector.register(descriptor, events, data)

    def forget(self, descriptor: int) -> None:
        """Stops watching a descriptor. Idempotent."""
        if descriptor in self._selector.get_map():
            self._selector.unregister(descriptor)

    def turn(self) -> None:
        """Waits for the next event and handles what is due."""
        ready = self._selector.select(self._next_timeout_s())
        for key, events in ready:
            current = self._selector.get_map().get(key.fd)
            if current is None or current.data is not key.data:
                continue  # an earlier callback of this turn closed or changed it
            on_readable, on_writable = key.data
            if events & selectors.EVENT_WRITE and on_writable is not None:
                on_writable()
            if events & selectors.EVENT_READ:
                on_readable()
        self._run_timers()

    def close(self) -> None:
        """Forgets everything. Idempotent."""
        self._timers.clear()
        self._posted.clear()
        if self._selector.get_map() is not None:
            self._selector.close()
            os.close(self._wake_receiver)
            os.close(self.wake_descriptor)

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
            for entry in due:  # a callback raised: the other timers, such as a ladder's, keep their turn
                heapq.heappush(self._timers, entry)


STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

#: A signal so soon after another is the same order twice: ``timeout`` signals the process and its group, and
#: kernel and shell both report a closed terminal.
ECHO_S = 0.2

#: A key that is held repeats its signal at shorter intervals, a person does not.
KEY_REPEAT_S = 0.06


class StopSignals:
    """Turns signals into calls on the loop while it is installed. Main thread only.

    Args:
        reactor: the supervisor's loop.
        on_signal: called with the number of each signal that is neither an echo of the one before nor the
            repetition of a held key.
    """

    def __init__(self, reactor: Reactor, on_signal: Callable[[int], None]) -> None:
        self._reactor = reactor
        self._on_signal = on_signal
        self._former: dict[int, Any] = {}
        self._former_descriptor = -1
        self._passed_s = self._received_s = float("-inf")

    def install(self) -> None:
        """Takes over the signals."""
        for number in STOP_SIGNALS:
            self._former[number] = signal.signal(
                number, lambda number, _frame: self._reactor.post(lambda: self._receive(number))
            )
        # The kernel's side of a signal wakes the loop, so that the handler above gets its turn.
        self._former_descriptor = signal.set_wakeup_fd(
            self._reactor.wake_descriptor, warn_on_full_buffer=False
        )

    def close(self) -> None:
        """Restores the former handlers. Idempotent."""
        if self._former:
            signal.set_wakeup_fd(self._former_descriptor)
        while self._former:
            signal.signal(*self._former.popitem())

    def _receive(self, number: int) -> None:
        now_s = self._reactor.now_s()
        is_held = now_s - self._received_s < KEY_REPEAT_S
        self._received_s = now_s
        if not is_held and now_s - self._passed_s > ECHO_S:
            self._passed_s = now_s
            self._on_signal(number)
