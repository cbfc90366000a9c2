"""Episodes on the robot: a model reports their begin and their mark, the arms their joints."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
from joshua.api.nodes import TopicSpec
from joshua.features import STATE

from joshua_evaluation.metrics import Episode

DIAGNOSTIC = "diagnostic_msgs/msg/DiagnosticStatus"


class Marks:
    """Collects episodes from messages, on the threads of the transport.

    Args:
        topics: of the states of the arms; the first one sets the steps of an episode.

    Attributes:
        runs: whether an episode runs; episodes: those that were marked, by their number.
    """

    def __init__(self, topics: Sequence[TopicSpec]) -> None:
        self._order = [topic.name for topic in topics]
        self._latest: dict[str, tuple[float, ...]] = {}
        self._states: list[tuple[float, ...]] = []
        self._stamps_ns: list[int] = []
        self._lock = threading.Lock()
        self.runs = False
        self.episodes: dict[int, Episode] = {}

    def state(self, topic: str, message: Any, received_ns: int) -> None:
        """Take the joints of an arm."""
        with self._lock:
            self._latest[topic] = tuple(message.position)
            if self.runs and topic == self._order[0] and len(self._latest) == len(self._order):
                self._states.append(sum((self._latest[name] for name in self._order), ()))
                self._stamps_ns.append(received_ns)

    def report(self, message: Any, received_ns: int) -> None:
        """Take the begin of an episode, or its mark; a second mark corrects the first."""
        del received_ns
        values = {item.key: item.value for item in message.values}
        number = int(values["number"])
        with self._lock:
            if message.message == "begin":
                self.runs = True
                self._states, self._stamps_ns = [], []
                return
            success, self.runs = message.message == "success", False
            latency_s = float(values["inference_latency_ms"]) / 1e3
            self.episodes[number] = self._episode(number, success, latency_s)

    def _episode(self, number: int, success: bool, latency_s: float) -> Episode:
        steps = max(1, len(self._states) - 1)
        span_s = (self._stamps_ns[-1] - self._stamps_ns[0]) / 1e9 if steps > 1 else 0.0
        rewards = np.zeros(steps)
        rewards[-1] = float(success)
        return Episode(
            seed=number,
            success=success,
            truncated=False,
            rewards=rewards,
            actions=np.zeros((steps, 0)),
            observations={STATE: np.array(self._states or [(0.0,)], np.float64)},
            latencies_s=np.array([latency_s]),
            period_s=span_s / steps if span_s > 0 else 1.0,
        )
