"""The receive queue of a Zenoh subscription, in two forms."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from joshua.transport.delivery import Delivery

_log = logging.getLogger("joshua.transport")
# a channel of Zenoh has a bound; this one stands for none
_UNBOUNDED = 2**31
Handle = Callable[[zenoh.Sample], None]


class ChannelIntake:
    """A channel of Zenoh itself: its network thread needs no Python to fill it.

    That saves the hand-over of the interpreter between two threads, about half of a small message's
    latency. Nothing of ours sees a sample arrive; it is seen when it is taken.

    Args:
        name: name of the thread.
        depth: length of the queue, the newest stay; None keeps everything.
        deliver: called with each sample on the thread.
        arrived: not called by this form.
    """

    def __init__(self, name: str, depth: int | None, deliver: Handle, arrived: Handle) -> None:
        self.handler: Any = (
            zenoh.handlers.FifoChannel(_UNBOUNDED) if depth is None else zenoh.handlers.RingChannel(depth)
        )
        self._name, self._deliver = name, deliver
        self._closed = False
        self._thread: threading.Thread | None = None

    def start(self, subscriber: Any) -> None:
        """Begins to deliver what the declared subscriber receives."""
        self._thread = threading.Thread(target=self._run, args=(subscriber,), name=self._name, daemon=True)
        self._thread.start()

    def close(self, undeclare: Callable[[], None]) -> None:
        """Undeclares the subscriber and ends the thread; nothing is delivered after the return."""
        self._closed = True
        undeclare()
        if self._thread is not None and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self, subscriber: Any) -> None:
        receive, deliver = subscriber.handler.recv, self._deliver
        while True:
            try:
                sample = receive()
            except zenoh.ZError:
                return  # undeclared
            if self._closed:
                return
            try:
                deliver(sample)
            except Exception:  # noqa: BLE001 - a failing callback must not end the subscription
                _log.exception("the callback of %s failed", self._name)
            # a sample kept here would keep its buffer until the next one arrives
            del sample


class WatchedIntake:
    """A queue of ours, for subscriptions with a deadline or a lease: arrivals count when they happen.

    Args:
        name: name of the thread.
        depth: length of the queue, the newest stay; None keeps everything.
        deliver: called with each sample on the thread.
        arrived: called with each sample on the network thread.
    """

    def __init__(self, name: str, depth: int | None, deliver: Handle, arrived: Handle) -> None:
        self._delivery = Delivery(name, depth, deliver)
        self._arrived = arrived
        self.handler: Any = zenoh.handlers.Callback(self._take, indirect=False)

    def start(self, subscriber: Any) -> None:
        """Nothing to begin: the handler delivers from the first sample on."""

    def close(self, undeclare: Callable[[], None]) -> None:
        """Undeclares the subscriber and ends the thread; nothing is delivered after the return."""
        undeclare()
        self._delivery.close()

    def _take(self, sample: zenoh.Sample) -> None:
        self._delivery.push(sample)
        self._arrived(sample)
