"""The newest value of each observed feature, and whether all of them are fresh enough to act on."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from joshua.api import Observation
from joshua.api.nodes import ModelArm
from joshua.features import Feature, FeatureError, FeatureSet, checked
from joshua.features.frame import Array
from joshua.messages import MessageError
from joshua.messages.arrays import acquired_ns, array_of

NS_PER_S = 1_000_000_000


class UnfitMessageError(Exception):
    """A message does not fit the model; the text names its topic and the reason."""


class _Newest(NamedTuple):
    message: Any
    received_ns: int
    monotonic_ns: int


class Observer:
    """Collector of observations; messages come from transport threads, observations go to the model's.

    A message becomes an array only when the model wants it, on the model's thread.

    Args:
        features: those that must be fresh, each with its topic.
        stale_after_s: largest age of a message.
        task: instruction in natural language; it may change.
        now_ns: the clock of the stamps.
        arms: several arms, whose states are the feature without a topic.
    """

    def __init__(
        self,
        features: FeatureSet,
        stale_after_s: float = 1.0,
        task: str = "",
        now_ns: Callable[[], int] = time.time_ns,
        arms: Sequence[ModelArm] = (),
    ) -> None:
        self._features = tuple(features.values())
        self._arms = tuple(arms)
        self._stale_after_ns = round(stale_after_s * NS_PER_S)
        self.task = task
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._newest: dict[str, _Newest] = {}
        self._past: dict[str, deque[_Newest]] = {}
        self._count, self._period_ns = 1, 0
        self._arrays: dict[str, deque[tuple[tuple[Any, ...], Array]]] = {}

    def use(self, features: FeatureSet) -> None:
        """Replace the features."""
        self._features, self._arrays = tuple(features.values()), {}

    def look_back(self, count: int, period_s: float) -> None:
        """Give the model ``count`` observations, one period apart, including the present one."""
        self._count, self._period_ns, self._arrays = count, round(period_s * NS_PER_S), {}

    def forget(self) -> None:
        """Forget the history: the first observation of an episode has none before it."""
        with self._lock:
            self._past.clear()

    def add(self, topic: str, message: Any, received_ns: int) -> None:
        """Add a message; ``received_ns`` since the epoch."""
        new = _Newest(message, received_ns, time.monotonic_ns())
        with self._lock:
            self._newest[topic] = new
            if self._count > 1:
                past = self._past.setdefault(topic, deque())
                past.append(new)
                oldest_ns = new.monotonic_ns - (self._count + 1) * self._period_ns
                while len(past) > self._count and past[1].monotonic_ns < oldest_ns:
                    past.popleft()

    def missing(self) -> tuple[str, ...]:
        """Return the topics without a fresh message."""
        oldest_ns = time.monotonic_ns() - self._stale_after_ns
        with self._lock:
            return tuple(
                topic
                for feature in self._features
                for topic in self._topics(feature)
                if topic not in self._newest or self._newest[topic].monotonic_ns < oldest_ns
            )

    def observation(self) -> Observation:
        """Return the newest value of each feature.

        Raises:
            UnfitMessageError: a message does not fit its feature; it is dropped, and its topic missing.
        """
        with self._lock:
            newest = dict(self._newest)
            past = {topic: tuple(messages) for topic, messages in self._past.items()}
        now = self._made(newest)
        earlier = []
        for step in range(1, self._count):
            moment_ns = now.stamp_ns - step * self._period_ns + self._period_ns // 2
            earlier.append(
                self._made({topic: _at(past.get(topic), moment_ns, newest[topic]) for topic in newest})
            )
        return replace(now, earlier=tuple(earlier))

    def _made(self, messages: dict[str, _Newest]) -> Observation:
        values, stamps_ns = {}, {}
        for feature in self._features:
            found = [messages[topic] for topic in self._topics(feature) if topic in messages]
            if len(found) == len(self._topics(feature)):
                values[feature.key] = self._array(feature, tuple(item.message for item in found))
                stamps_ns[feature.key] = min(acquired_ns(item.message, item.received_ns) for item in found)
        now_ns = self._now_ns()  # the clock of another machine may be ahead
        stamp_ns = min(max(stamps_ns.values(), default=0) or now_ns, now_ns)
        return Observation(stamp_ns, values, stamps_ns, task=self.task)

    def _topics(self, feature: Feature) -> tuple[str, ...]:
        if feature.topic or not self._arms:
            return (feature.topic,)
        return tuple(arm.state for arm in self._arms)

    def _array(self, feature: Feature, messages: tuple[Any, ...]) -> Array:
        """Return the array of a message, or of one message of each arm, made once."""
        known = self._arrays.setdefault(feature.key, deque(maxlen=self._count))
        for others, array in known:
            if all(other is message for other, message in zip(others, messages, strict=True)):
                return array
        topics = self._topics(feature)
        joints = (feature.names,) if feature.topic else tuple(arm.joints for arm in self._arms)
        parts = []
        for topic, message, names in zip(topics, messages, joints, strict=True):
            try:
                part = array_of(message, names)
                parts.append(checked(feature, part) if feature.topic else part)
            except (MessageError, FeatureError) as error:
                self._drop(topic, message)
                raise UnfitMessageError(f"a message on {topic} is not used: {error}") from error
        made = parts[0] if feature.topic else checked(feature, self._whole(feature, parts))
        known.append((messages, made))
        return made

    def _whole(self, feature: Feature, parts: Sequence[Array]) -> Array:
        """The positions of all arms, in the order of the model."""
        order = [name for arm in self._arms for name in arm.names]
        return np.concatenate(parts)[[order.index(name) for name in feature.names]]

    def _drop(self, topic: str, message: Any) -> None:
        with self._lock:
            if topic in self._newest and self._newest[topic].message is message:
                del self._newest[topic]
            past = self._past.get(topic)
            if past is not None:
                self._past[topic] = deque(item for item in past if item.message is not message)


def _at(past: tuple[_Newest, ...] | None, moment_ns: int, newest: _Newest) -> _Newest:
    """Return the newest message at a moment; the first one if there was none yet."""
    known = past or (newest,)
    before = [item for item in known if acquired_ns(item.message, item.received_ns) <= moment_ns]
    return before[-1] if before else known[0]
