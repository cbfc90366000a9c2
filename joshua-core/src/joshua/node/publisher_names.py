"""Which node a message comes from: asked of the graph once for each publisher, then remembered."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

#: The graph may learn of a publisher after its first messages; one that it has not learnt of by then belongs
#: to no node, as far as is known: the graph is asked again each time that this has passed.
KNOWN_WITHIN_S = 1.0
_ASK_EVERY_S = 0.02
# gids come from outside: what is remembered is bounded
_MOST_PUBLISHERS = 1000
_Value = TypeVar("_Value")


class PublisherNames:
    """Names of the nodes that publish on one topic, by the identity that their messages carry.

    Args:
        look_up: asks the graph; "" while it does not know.
        clock: seconds, monotonic.
    """

    def __init__(self, look_up: Callable[[bytes], str], clock: Callable[[], float] = time.monotonic) -> None:
        self._look_up = look_up
        self._clock = clock
        self._names: dict[bytes, str] = {}
        self._waiting: dict[bytes, tuple[float, float]] = {}

    def name(self, publisher_gid: bytes) -> str | None:
        """Full name of the publisher's node, "" for one that belongs to no node, None while not known."""
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
