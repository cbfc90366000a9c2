"""Writes text on a thread of its own, so that a slow disk or a stopped terminal holds up nobody."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

_T = TypeVar("_T")

#: Lines that may wait; beyond that the newest are dropped and counted.
MAX_WAITING = 5000


class BackgroundWriter(Generic[_T]):
    """Hands lines, of whatever type, to a function on one thread, in order.

    Args:
        write: called with each batch of lines; what it raises ends the writer.
        name: of the thread.
    """

    def __init__(self, write: Callable[[list[_T]], None], name: str) -> None:
        self._write = write
        self._lines: deque[_T] = deque()
        self._condition = threading.Condition()
        self._closing = False
        self._dropped = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._started = False

    @property
    def dropped(self) -> int:
        """Lines that found the queue full."""
        return self._dropped

    def put(self, line: _T) -> None:
        """Queues a line; never blocks."""
        with self._condition:
            if self._closing or len(self._lines) >= MAX_WAITING:
                self._dropped += 1
                return
            self._lines.append(line)
            if not self._started:
                self._started = True
                self._thread.start()
            self._condition.notify()

    def close(self, timeout_s: float) -> bool:
        """Writes what waits; returns whether that was done in time."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._started:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._condition:
                while not self._lines and not self._closing:
                    self._condition.wait()
                if not self._lines:
                    return
                batch = list(self._lines)
                self._lines.clear()
            self._write(batch)
