"""A subscription whose samples are handled on the main thread, where Ctrl-C and a closed pipe arrive."""

from __future__ import annotations

import contextlib
import os
import queue
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.cli.graph.session import GraphError

if TYPE_CHECKING:
    from joshua.plan import QosProfile
    from joshua.transport import Sample, Subscription, Transport

# The oldest ones go when more than this many wait to be printed.
_WAITING = 1000
_TICK_S = 0.1


@dataclass(frozen=True)
class Arrival:
    """A received payload and its time on the monotonic clock."""

    cdr: Any
    time_s: float


def arrivals(
    transport: Transport, topic: str, type_name: str, qos: QosProfile, timeout_s: float | None = None
) -> Iterator[Arrival | None]:
    """Subscribes; yields what arrives, and None about ten times a second where nothing does.

    Says on standard error when the last publisher leaves, and when one is there again.

    Raises:
        GraphError: nothing came for ``timeout_s``.
    """
    waiting: queue.Queue[Arrival] = queue.Queue(_WAITING)

    def callback(sample: Sample) -> None:
        arrival = Arrival(sample.cdr, time.monotonic())
        with contextlib.suppress(queue.Empty):
            if waiting.full():
                waiting.get_nowait()
        waiting.put_nowait(arrival)

    node = transport.create_node(f"_joshua_{os.getpid()}")
    subscription = node.create_subscription(topic, type_name, qos, callback)
    publishers = _Publishers(subscription, topic)
    silent_s = 0.0
    while True:
        try:
            arrival = waiting.get(timeout=_TICK_S)
            silent_s = 0.0
            publishers.heard()
            yield arrival
        except queue.Empty:
            publishers.look()
            silent_s += _TICK_S  # not by the clock: a time in which this program stood still is no silence
            if timeout_s is not None and silent_s >= timeout_s:
                raise GraphError(
                    f"no message came on {topic} within {timeout_s:g} s: {publishers.state}; wait longer "
                    "with --timeout"
                ) from None
            yield None


class _Publishers:
    """The publishers of a topic, as far as they come and go."""

    def __init__(self, subscription: Subscription, topic: str) -> None:
        self._subscription, self._topic = subscription, topic
        # one that leaves before the first look, or while messages come without a pause, has been there
        self._count = self._most = subscription.publisher_count

    def look(self) -> None:
        """Says when the last one has left, and when one is there again."""
        before, self._count = self._count, self._subscription.publisher_count
        if before and not self._count:
            sys.stderr.write(
                f"the last publisher of {self._topic} has left; waiting for another (Ctrl-C ends)\n"
            )
        elif self._count and not before and self._most:
            sys.stderr.write(f"{self._topic} has a publisher again\n")
        self._most = max(self._most, self._count)

    def heard(self) -> None:
        """A message has come, from a publisher that perhaps no look has seen yet."""
        if not self._count:
            self.look()

    @property
    def state(self) -> str:
        """Why nothing may have come."""
        if self._count:
            return f"it has {self._count} publisher{'s' * (self._count > 1)}, of whom none sends"
        return "its last publisher has left" if self._most else "nobody publishes it"
