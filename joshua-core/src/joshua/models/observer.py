"""The newest message of each observed topic, and whether all of them are fresh enough to act on."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from joshua.models.model import Observation

NS_PER_S = 1_000_000_000

#: Age at which an observation is too old to act on.
STALE_AFTER_S = 1.0


class Observer:
    """Collects observations; messages come from transport threads, observations go to the model's.

    Args:
        topics: that must be fresh.
        stale_after_s: largest age of a message.
        task: instruction in natural language.
    """

    def __init__(self, topics: Sequence[str], stale_after_s: float = STALE_AFTER_S, task: str = "") -> None:
        self._topics = tuple(topics)
        self._stale_after_ns = round(stale_after_s * NS_PER_S)
        self._task = task
        self._lock = threading.Lock()
        self._newest: dict[str, tuple[Any, int, int]] = {}

    def add(self, topic: str, message: Any, received_ns: int) -> None:
        """Takes a message; ``received_ns`` since the epoch."""
        with self._lock:
            self._newest[topic] = (message, received_ns, time.monotonic_ns())

    def missing(self) -> tuple[str, ...]:
        """Topics without a fresh message."""
        oldest_ns = time.monotonic_ns() - self._stale_after_ns
        with self._lock:
            return tuple(
                topic
                for topic in self._topics
                if topic not in self._newest or self._newest[topic][2] < oldest_ns
            )

    def observation(self) -> Observation:
        """The newest message of each topic."""
        with self._lock:
            stamp_ns = max((received_ns for _, received_ns, _ in self._newest.values()), default=0)
            messages = {topic: message for topic, (message, _, _) in self._newest.items()}
        return Observation(stamp_ns or time.time_ns(), messages, self._task)
