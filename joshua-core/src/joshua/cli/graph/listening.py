"""A subscription whose samples are handled on the main thread, where Ctrl-C and a closed pipe arrive."""

from __future__ import annotations

import contextlib
import os
import queue
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.plan import QosProfile
    from joshua.transport import Sample, Transport

# The oldest ones go when more than this many wait to be printed.
_WAITING = 1000
_TICK_S = 0.1


@dataclass(frozen=True)
class Arrival:
    """A received payload and its time on the monotonic clock."""

    cdr: Any
    time_s: float


def arrivals(transport: Transport, topic: str, type_name: str, qos: QosProfile) -> Iterator[Arrival | None]:
    """Subscribes; yields what arrives, and None about ten times a second where nothing does."""
    waiting: queue.Queue[Arrival] = queue.Queue(_WAITING)

    def callback(sample: Sample) -> None:
        arrival = Arrival(sample.cdr, time.monotonic())
        with contextlib.suppress(queue.Empty):
            if waiting.full():
                waiting.get_nowait()
        waiting.put_nowait(arrival)

    node = transport.create_node(f"_joshua_{os.getpid()}")
    node.create_subscription(topic, type_name, qos, callback)
    while True:
        try:
            yield waiting.get(timeout=_TICK_S)
        except queue.Empty:
            yield None
