"""Who sent a message: the publisher by its id, and the name of its node once the graph knows it.

The id is in each message, or known to the middleware from the connection. The name comes by another way and
may arrive after the first messages. Compare writers, not names.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

#: The graph may learn of a publisher after its first messages; one that it has not learnt of by then belongs
#: to no node, as far as is known: the graph is asked again each time that this has passed.
KNOWN_WITHIN_S = 1.0
_ASK_EVERY_S = 0.02
# gids come from outside, so the table is bounded
_MOST_PUBLISHERS = 1000
_Value = TypeVar("_Value")


class Writer:
    """The publisher of a message.

    Args:
        gid: id of the publisher, unique in the graph; empty if the message has none.
        look_up: returns the full name of its node, "" for a publisher without a node, None while unknown.
    """

    def __init__(self, gid: bytes, look_up: Callable[[bytes], str | None]) -> None:
        self.gid = gid
        self._look_up = look_up
        self._name = ""

    @classmethod
    def of_node(cls, name: str) -> Writer:
        """A publisher of a node whose name is known."""
        return cls(name.encode(), lambda _: name)

    @property
    def name(self) -> str:
        """Full name of its node; "" if it has none, or while it is unknown."""
        if not self._name:
            self._name = self._look_up(self.gid) or ""
        return self._name

    @property
    def awaits_name(self) -> bool:
        """Whether the graph may still learn the name of its node: for one second from its first message."""
        return not self._name and self._look_up(self.gid) is None

    def same_node(self, other: Writer | None) -> bool:
        """Whether both are the same publisher, or publishers of one node."""
        if other is None:
            return False
        if self.gid == other.gid:
            return True
        name = self.name
        return bool(name) and name == other.name


class PublisherNames:
    """Names of the nodes that publish on one topic, by the publisher id in their messages. Thread-safe.

    Args:
        look_up: queries the graph; "" while unknown.
        clock: seconds, monotonic.
    """

    def __init__(self, look_up: Callable[[bytes], str], clock: Callable[[], float] = time.monotonic) -> None:
        self._look_up = look_up
        self._clock = clock
        self._lock = threading.Lock()
        self._writers: dict[bytes, Writer] = {}
        self._names: dict[bytes, str] = {}
        self._waiting: dict[bytes, tuple[float, float]] = {}

    def writer(self, publisher_gid: bytes) -> Writer:
        """The publisher with an id."""
        writer = self._writers.get(publisher_gid)
        if writer is None:
            writer = Writer(publisher_gid, self.name)
            self._remember(self._writers, publisher_gid, writer)
        return writer

    def name(self, publisher_gid: bytes) -> str | None:
        """Full name of the publisher's node, "" for one without a node, None while unknown."""
        with self._lock:
            return self._names.get(publisher_gid) or self._ask(publisher_gid)

    def _ask(self, publisher_gid: bytes) -> str | None:
        if not publisher_gid:
            return ""
        now_s = self._clock()
        since_s, next_s = self._waiting.get(publisher_gid, (now_s, now_s))
        if now_s >= next_s:
            name = self._look_up(publisher_gid)
            if name:
                self._waiting.pop(publisher_gid, None)
                self._remember(self._names, publisher_gid, name)
                return name
            pause_s = _ASK_EVERY_S if now_s - since_s < KNOWN_WITHIN_S else KNOWN_WITHIN_S
            self._remember(self._waiting, publisher_gid, (since_s, now_s + pause_s))
        return None if now_s - since_s < KNOWN_WITHIN_S else ""

    @staticmethod
    def _remember(table: dict[bytes, _Value], publisher_gid: bytes, value: _Value) -> None:
        if len(table) >= _MOST_PUBLISHERS:
            table.clear()
        table[publisher_gid] = value
