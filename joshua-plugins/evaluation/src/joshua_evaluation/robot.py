"""Episodes on the robot: a model reports their begin and their mark, the arms their joints."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from joshua.api import NodeContext
from joshua.api.nodes import TopicSpec
from joshua.features import STATE
from joshua.messages.arrays import picture
from joshua.tools import CallError, RunningSystem
from joshua_training.run_folder import RunError

from joshua_evaluation.metrics import Episode
from joshua_evaluation.videos import Film

DIAGNOSTIC = "diagnostic_msgs/msg/DiagnosticStatus"
PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

#: How long a model may load weights; the first time it imports its libraries.
LOAD_S = 600.0

#: Intervals at which an evaluation looks for marks, and at the state of the other nodes.
_LOOK_S, _STATES_S = 0.1, 1.0

#: States of a node that acts, or that ends with the run.
_WELL = ("ready", "stopping", "stopped", "killed")


class UnansweredError(Exception):
    """Nobody began or marked an episode for too long."""


class Marks:
    """Collects episodes from messages, on the threads of the transport.

    Args:
        topics: of the states of the arms; the first one sets the steps of an episode.

    Attributes:
        runs: whether an episode runs; episodes: those that were marked, in their order; films: of each.
    """

    def __init__(self, topics: Sequence[TopicSpec]) -> None:
        self._order = [topic.name for topic in topics]
        self._latest: dict[str, tuple[float, ...]] = {}
        self._states: list[tuple[float, ...]] = []
        self._stamps_ns: list[int] = []
        self._film = Film()
        self._lock = threading.Lock()
        self.restart()

    def restart(self) -> None:
        """Forget all episodes."""
        with self._lock:
            self.runs = self._ended = False
            self.episodes: list[Episode] = []
            self.films: list[Film] = []

    def state(self, topic: str, message: Any, received_ns: int) -> None:
        """Take the joints of an arm."""
        with self._lock:
            self._latest[topic] = tuple(message.position)
            if self.runs and topic == self._order[0] and len(self._latest) == len(self._order):
                self._states.append(sum((self._latest[name] for name in self._order), ()))
                self._stamps_ns.append(received_ns)

    def picture(self, message: Any, received_ns: int) -> None:
        """Take a picture of the camera."""
        if self.runs and self._film.wants(received_ns):
            self._film.add(picture(message), received_ns)

    def report(self, message: Any, received_ns: int) -> None:
        """Take the begin of an episode, or its mark; a second mark corrects the first."""
        del received_ns
        values = {item.key: item.value for item in message.values}
        with self._lock:
            if message.message == "begin":
                self._states, self._stamps_ns, self._film = [], [], Film()
                self.runs, self._ended = True, False
                return
            if not (self.runs or self._ended):  # of an episode before the restart
                return
            if self._ended:
                self.episodes.pop()
            else:
                self.films.append(self._film)
            success, self.runs, self._ended = message.message == "success", False, True
            latency_s = float(values["inference_latency_ms"]) / 1e3
            self.episodes.append(self._episode(len(self.episodes) + 1, success, latency_s))

    def _episode(self, number: int, success: bool, latency_s: float) -> Episode:
        steps = max(1, len(self._states) - 1)
        span_s = (self._stamps_ns[-1] - self._stamps_ns[0]) / 1e9 if steps > 1 else 0.0
        return Episode(
            seed=number,
            success=success,
            truncated=False,
            rewards=np.zeros(steps),  # a robot gives none
            actions=np.zeros((steps, 0)),
            observations={STATE: np.array(self._states or [(0.0,)], np.float64)},
            latencies_s=np.array([latency_s]),
            period_s=span_s / steps if span_s > 0 else 1.0,
        )


class Robot:
    """The model and the arms of this run, in episodes that a person marks.

    Args:
        context: of the node, whose subscriptions are those of an evaluation on the robot.

    Attributes:
        marks: the episodes; filmed: whether a camera shows them.
        stopped: which nodes are stopped and what resumes them, for the end of a line; "" if none is.
    """

    def __init__(self, context: NodeContext) -> None:
        self._context, topics = context, context.spec.subscriptions
        self.marks = Marks([item for item in topics if item.type_name not in (DIAGNOSTIC, *PICTURES)])
        self.filmed, self.stopped = False, ""
        self._models: list[str] = []
        self._weights, self._restarts = "", 0
        for topic in topics:
            take: Callable[[Any, int], None] = partial(self.marks.state, topic.name)
            if topic.type_name == DIAGNOSTIC:
                self._models.append(topic.name.removesuffix("/episode"))
                take = self.marks.report
            elif topic.type_name in PICTURES:
                self.filmed, take = True, self.marks.picture
            context.subscribe(topic, take)

    def use(self, weights: str) -> None:
        """Let the model load weights. Raises RunError: it cannot."""
        self._weights = ""
        self._restarts = sum(node.restarts for node in self._nodes() if node.full_name in self._models)
        self._call("use_weights", {"path": weights}, LOAD_S)
        self._weights = weights

    def rest(self) -> None:
        """Let the model free its weights: it moves nothing until it gets others. Raises RunError."""
        self._weights = ""
        self._call("unload", {}, 30.0)

    def wait(
        self, count: int, told: Callable[[str], None], patience_s: float = math.inf, goal: int = 0
    ) -> bool:
        """Wait until so many episodes are marked.

        Args:
            told: takes the state, for the status line; goal: number of episodes of the evaluation, 0 for
                ``count``.
            patience_s: longest time without a begin or a mark; a fault of an arm is to be ended within it.

        Returns:
            False if the run stops.

        Raises:
            UnansweredError: nobody began or marked an episode for too long.
            RunError: a restarted model cannot load its weights.
        """
        marks, before, since_s = self.marks, (-1, False), time.monotonic()
        seen_s = -math.inf
        while not self._context.stopping:
            done, runs = len(marks.episodes), marks.runs
            self._context.progress("evaluation", float(done), float(goal or count), unit="episodes")
            for film in marks.films[:done]:
                film.develop()
            if done >= count:
                return True
            now_s = time.monotonic()
            if now_s - seen_s >= _STATES_S:
                self.stopped, seen_s = self._stopped(), now_s
            if (done, runs) != before:
                before, since_s = (done, runs), now_s
            elif now_s - since_s > patience_s:
                wanted = "marked" if runs else "began"
                found = f"nobody {wanted} episode {done + 1} within {patience_s:g} s"
                raise UnansweredError(found + self.stopped)
            told(f"episode {done + 1} runs" if runs else f"waiting for episode {done + 1}")
            time.sleep(_LOOK_S)
        return False

    def _stopped(self) -> str:
        """Return which nodes are stopped, and what resumes them; give a restarted model its weights again."""
        nodes = self._nodes()
        model = next((node for node in nodes if node.full_name in self._models), None)
        if self._weights and model and model.state == "ready" and model.restarts != self._restarts:
            self._context.warn(
                f"{model.full_name} was restarted: it loads its weights again; begin the episode anew"
            )
            self.use(self._weights)
        return "".join(
            f"; {node.full_name} is in the state {node.state}: see `joshua status`, then run `joshua resume "
            f"{node.full_name.strip('/')}`"
            for node in nodes
            if node.state not in _WELL
        )

    def _nodes(self) -> Sequence[Any]:
        """Return the status of each node of this run; none where it cannot be asked."""
        try:
            return self._system().status().nodes
        except (RunError, CallError):
            return ()

    def _call(self, verb: str, request: dict[str, Any], timeout_s: float) -> None:
        if len(self._models) != 1:
            names = " and ".join(self._models)
            raise RunError(f"{names} would get the same weights: keep one model in the file")
        try:  # the nodes become active in no order: one that has not yet is waited for
            self._system().call(self._models[0], verb, request, timeout_s=timeout_s, start=True)
        except CallError as error:
            raise RunError(str(error)) from error

    def _system(self) -> RunningSystem:
        """Return this run. Raises RunError, CallError."""
        own = self._context.spec.full_name
        for system in RunningSystem.all():
            if system.has(own) and any(
                node.full_name == own and node.process_id == os.getpid() for node in system.status().nodes
            ):
                return system
        raise RunError("this run is not among those of this user, so its model cannot be reached")
