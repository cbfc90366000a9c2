"""The receive queue of a subscription: filled by the network thread, emptied by a separate thread."""

from __future__ import annotations

import _thread
import contextlib
import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

_log = logging.getLogger("joshua.transport")


class Delivery:
    """Passes items to a callback one at a time, on one thread, in order.

    With KEEP_LAST the queue holds the newest ``depth`` items, so a slow callback gets fresh data and never
    blocks the network thread.

    Args:
        name: name of the thread.
        depth: length of the queue; None keeps everything.
        handle: called with each item.
    """

    def __init__(self, name: str, depth: int | None, handle: Callable[[Any], None]) -> None:
        self._items: deque[Any] = deque(maxlen=depth)
        self._handle = handle
        # a bare lock used as a binary semaphore is the cheapest wake-up that Python has
        self._wake = _thread.allocate_lock()
        self._wake.acquire()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def push(self, item: Any) -> None:
        """Queues an item, and drops the oldest one if the queue is full."""
        self._items.append(item)
        try:
            self._wake.release()
        except RuntimeError:
            return  # a wake-up is pending already

    def close(self) -> None:
        """Ends the thread. The callback does not run after the return."""
        self._closed = True
        self._items.clear()
        with contextlib.suppress(RuntimeError):  # it wakes soon anyway
            self._wake.release()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        items, handle, wait = self._items, self._handle, self._wake.acquire
        while not self._closed:
            try:
                item = items.popleft()
            except IndexError:
                wait()
                continue
            try:
                handle(item)
            except Exception:  # noqa: BLE001 - a failing callback must not end the subscription
                _log.exception("the callback of %s failed", self._thread.name)
            # a reference here would keep its buffer until the next one arrives
            del item
