"""The newest value of each observed feature, and whether all of them are fresh enough to act on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from joshua.api import Observation
from joshua.features import FeatureError, FeatureSet, checked
from joshua.features.frame import Array
from joshua.messages import MessageError
from joshua.messages.arrays import acquired_ns, array_of

NS_PER_S = 1_000_000_000


class UnfitMessageError(Exception):
    """A message cannot be shown to the model; says on which topic and why."""


class _Newest(NamedTuple):
    message: Any
    received_ns: int
    monotonic_ns: int


class Observer:
    """Collects observations; messages come from transport threads, observations go to the model's.

    A message becomes an array only when the model wants it, on the model's thread.

    Args:
        features: that must be fresh, each with its topic.
        stale_after_s: largest age of a message.
        task: instruction in natural language; it may change.
        now_ns: the clock of the stamps.
    """

    def __init__(
        self,
        features: FeatureSet,
        stale_after_s: float = 1.0,
        task: str = "",
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._features = tuple(features.values())
        self._stale_after_ns = round(stale_after_s * NS_PER_S)
        self.task = task
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._newest: dict[str, _Newest] = {}
        self._arrays: dict[str, tuple[Any, Array]] = {}

    def use(self, features: FeatureSet) -> None:
        """Takes features in place of those before."""
        self._features, self._arrays = tuple(features.values()), {}

    def add(self, topic: str, message: Any, received_ns: int) -> None:
        """Takes a message; ``received_ns`` since the epoch."""
        with self._lock:
            self._newest[topic] = _Newest(message, received_ns, time.monotonic_ns())

    def missing(self) -> tuple[str, ...]:
        """Topics without a fresh message."""
        oldest_ns = time.monotonic_ns() - self._stale_after_ns
        with self._lock:
            return tuple(
                feature.topic
                for feature in self._features
                if feature.topic not in self._newest or self._newest[feature.topic].monotonic_ns < oldest_ns
            )

    def observation(self) -> Observation:
        """The newest value of each feature.

        Raises:
            UnfitMessageError: a message does not fit its feature; it is dropped, and its topic missing.
        """
        with self._lock:
            newest = dict(self._newest)
        seen = [feature for feature in self._features if feature.topic in newest]
        values, stamps_ns = {}, {}
        for feature in seen:
            message, received_ns, _ = newest[feature.topic]
            known = self._arrays.get(feature.key)
            if known is None or known[0] is not message:
                try:
                    known = message, checked(feature, array_of(message, feature.names))
                except (MessageError, FeatureError) as error:
                    self._drop(feature.topic, message)
                    raise UnfitMessageError(f"a message on {feature.topic} is not used: {error}") from error
                self._arrays[feature.key] = known
            values[feature.key] = known[1]
            stamps_ns[feature.key] = acquired_ns(message, received_ns)
        now_ns = self._now_ns()  # the clock of another machine may be ahead
        stamp_ns = min(max(stamps_ns.values(), default=0) or now_ns, now_ns)
        return Observation(stamp_ns, values, stamps_ns, task=self.task)

    def _drop(self, topic: str, message: Any) -> None:
        with self._lock:
            if topic in self._newest and self._newest[topic].message is message:
                del self._newest[topic]
