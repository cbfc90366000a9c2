"""Who commands an actuator: while a publisher declared as override sends, nobody else."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from enum import Enum
from typing import Any

NS_PER_S = 1_000_000_000

#: Silence of the override publisher after which the others' commands count again.
RELEASED_AFTER_S = 0.5


class Turn(Enum):
    """What a command is worth."""

    OURS = "ours"
    """It comes from the one who commands."""
    FIRST = "first"
    """So it does, and its publisher has just come to command: the joints must approach it slowly."""
    NOT_OURS = "not ours"
    """Somebody else commands; it is to be ignored."""


class TakeOver:
    """Decides between the publishers that command one actuator.

    Args:
        overriding: full names of the nodes that take over.
        log: where a change of hands is reported.
        released_after_s: silence of the overriding node after which the others command again.
    """

    def __init__(
        self, overriding: Iterable[str], log: Any, *, released_after_s: float = RELEASED_AFTER_S
    ) -> None:
        self._overriding = frozenset(overriding)
        self._log = log
        self._released_after_s = released_after_s
        # two topics can command one actuator, each on a thread of its own
        self._lock = threading.Lock()
        self._holder = ""
        self._until_ns = 0

    def turn(self, publisher: str, now_ns: int, lasts_s: float = 0.0) -> Turn:
        """Whether a command counts.

        Args:
            publisher: full name of the node that sent it.
            now_ns: on the monotonic clock.
            lasts_s: how long the command goes on by itself; a trajectory plays that long.
        """
        with self._lock:
            if publisher in self._overriding:
                return self._override(publisher, now_ns, lasts_s)
            if not self._holder:
                return Turn.OURS
            if now_ns < self._until_ns:
                return Turn.NOT_OURS
            self._log.info(
                "%s has been silent for %g s: other commands count again",
                self._holder,
                self._released_after_s,
            )
            self._holder = ""
            return Turn.FIRST

    def _override(self, publisher: str, now_ns: int, lasts_s: float) -> Turn:
        first = self._holder != publisher
        if first:
            self._log.warning("%s takes over: commands of others are ignored while it sends", publisher)
        self._holder = publisher
        self._until_ns = now_ns + round((lasts_s + self._released_after_s) * NS_PER_S)
        return Turn.FIRST if first else Turn.OURS
