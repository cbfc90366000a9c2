"""The node of a model: observations in, actions out at the publisher's rate."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from functools import partial

import numpy as np

from joshua.features.feature_set import FeatureSet
from joshua.messages.arrays import COMPRESSED_IMAGE, holds_numbers, load_decoder
from joshua.messages.make import joint_state
from joshua.messages.typestore import MessageError
from joshua.models.chunk_player import ChunkPlayer
from joshua.models.model import FloatArray, JointSpace, Model, ModelError
from joshua.models.observer import Observer, UnfitMessageError
from joshua.node.behaviour import NodeBehaviour
from joshua.node.cadence import TrafficFigures
from joshua.node.context import NodeContext
from joshua.node.endpoints import Outputs
from joshua.node.errors import NodeError
from joshua.node.implementation import load_implementation
from joshua.node.verbs import RefusedError, verb
from joshua.plan import JointRange, ModelFacts

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Share of periods without an action that still counts as keeping up.
GAPS_MAX = 0.05

#: Longest wait of the model's thread, so that the stop is noticed.
WAIT_S = 0.2

#: Distance of two looks whether a model is loaded again.
UNLOADED_S = 0.02


class InferenceNode(NodeBehaviour):
    """The standard behaviour of models.

    A thread runs the model whenever a chunk of actions is wanted and every subscribed topic is fresh; a timer
    at the publisher's rate plays the chunk. While a topic is stale nothing is published, so that the
    actuator's own watchdog holds it.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        facts = context.spec.facts_as(ModelFacts)
        self._model: Model | None = None
        self._joints = joint_space(facts.joints)
        self._rate_hz = max((topic.rate_hz for topic in context.spec.publishers), default=0.0)
        self._acting = threading.Lock()
        self._player = ChunkPlayer()
        self._features = FeatureSet(facts.features)
        self._observer = Observer(
            self._features,
            facts.execution.observation_max_age_s,
            facts.task,
        )
        self._outputs = Outputs(())
        self._received: list[TrafficFigures] = []
        self._runs = False
        self._silent_about: tuple[str, ...] = ()
        self._said: deque[str] = deque(maxlen=16)
        self._chunks = self._periods = self._gaps = 0
        self._started = False

    def configure(self) -> None:
        """Loads the model and declares topics. Raises ModelError, TargetError."""
        spec = self.context.spec
        for topic in spec.publishers:
            if topic.type_name != JOINT_STATE:
                raise ModelError(
                    f"{spec.full_name} cannot publish {topic.type_name} on {topic.name}: a model publishes "
                    "joint positions; set data_type: JOINT_STATE"
                )
        if not spec.publishers:
            raise ModelError(f"{spec.full_name} publishes no action: add a publisher of type JOINT_STATE")
        if not self._joints.names:
            raise ModelError(
                f"{spec.full_name} does not know its joints: let an actuator subscribe to "
                f"{spec.publishers[0].name}"
            )
        for topic in spec.subscriptions:
            if not holds_numbers(topic.type_name):
                raise ModelError(
                    f"{spec.full_name} cannot observe {topic.type_name} on {topic.name}: it holds no numbers"
                )
            if topic.type_name == COMPRESSED_IMAGE:
                try:
                    load_decoder()
                except MessageError as error:
                    raise ModelError(f"{spec.full_name}: {error}") from error
        self._model = self._loaded()
        self._outputs = Outputs(map(self.context.publisher, spec.publishers), self._rate_hz)
        self._received = [
            self.context.subscribe(topic, partial(self._observer.add, topic.name))
            for topic in spec.subscriptions
        ]

    def verb_providers(self) -> tuple[object, ...]:
        """The node's own verbs, and those of its model."""
        return (self,) if self._model is None else (self, self._model)

    @verb(moves=True, runs="beside")
    def load(self) -> str:
        """Loads the model, which then acts again."""
        name = self.context.spec.full_name
        if self._model is not None:
            raise RefusedError(f"{name} has already loaded its model: unload it first")
        try:
            model = self._loaded()
        except Exception as error:  # a plugin's code; the node goes on without a model
            kind = "" if isinstance(error, (NodeError, ModelError)) else f"{type(error).__name__}: "
            raise RefusedError(f"{name}: the model was not loaded: {kind}{error}") from error
        if self.context.stopping:
            model.close()
            raise RefusedError(f"{name} stops")
        self.context.show("")
        self._model = model
        return f"{name}: the model is loaded"

    @verb(moves=False, runs="beside")
    def unload(self) -> str:
        """Frees the model; nothing is published then, so that the actuator holds its position."""
        name = self.context.spec.full_name
        with self._acting:  # the model is done with what it computes just now
            model, self._model = self._model, None
            self._player.clear()
        if model is None:
            raise RefusedError(f"{name} has no model: load it first")
        model.close()
        self.context.show("no model")
        return f"{name}: the model is unloaded; the node publishes nothing"

    def activate(self) -> None:
        """Starts the model's thread and the timer of the actions."""
        if self._runs:
            return
        self._runs = True
        self.context.spawn_thread(self._infer, name="model")
        self.context.create_timer(1 / self._rate_hz, self._play, name="actions")

    def deactivate(self) -> None:
        """Plays nothing any more."""
        self._player.clear()

    def cleanup(self) -> None:
        """Frees the model."""
        if self._model is not None:
            self._model.close()

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Rates of actions and observations, and whether the model kept up."""
        rows = self._outputs.checks()
        for item in self._received:
            measured = f"{item.count} at {item.rate_hz:.4g} Hz"
            rows.append((f"observations on {item.topic.name}", item.count > 0, measured))
        kept_up = self._chunks > 0 and self._gaps <= GAPS_MAX * self._periods
        measured = f"{self._chunks} chunks, {self._gaps} of {self._periods} periods without an action"
        rows.append(("model keeps up", kept_up, measured))
        return rows

    def _infer(self) -> None:
        """Runs the model until the stop; whatever it raises fails the node."""
        while not self.context.stopping:
            if not self._player.wait_until_wanted(WAIT_S) or self._observations_missing():
                continue
            try:
                observation = self._observer.observation()
            except UnfitMessageError as error:
                self._say_once(str(error))
                continue
            with self._acting:
                if (model := self._model) is not None:
                    self._player.put(self._checked(model.act(observation)))
                    self._chunks += 1
            if model is None:
                time.sleep(UNLOADED_S)

    def _loaded(self) -> Model:
        implementation, settings = load_implementation(self.context.spec, Model)
        model: Model = implementation(settings, self._joints, self._features)
        try:
            model.load()
            model.reset()
        except BaseException:
            model.close()
            raise
        return model

    def _observations_missing(self) -> bool:
        """Whether a topic is stale; says so once, and waits a little before the next look."""
        missing = self._observer.missing()
        if missing != self._silent_about:
            self._silent_about = missing
            if missing:
                self.context.log.warning("waiting for a message on %s", ", ".join(missing))
            else:
                self.context.log.info("all observations are up to date")
        if missing:
            time.sleep(0.01)
        return bool(missing)

    def _say_once(self, text: str) -> None:
        if text not in self._said:
            self._said.append(text)
            self.context.log.warning("%s", text)

    def _checked(self, actions: FloatArray) -> FloatArray:
        """Returns a model's actions clipped to the limits. Raises ModelError for any other shape or NaN."""
        chunk = np.asarray(actions, np.float64)
        count, name = len(self._joints.names), type(self._model).__name__
        if chunk.ndim != 2 or chunk.shape[0] < 1 or chunk.shape[1] != count:
            raise ModelError(
                f"{name}.act returned shape {chunk.shape}; {count} joints need (T, {count}), T ≥ 1"
            )
        if not np.isfinite(chunk).all():
            raise ModelError(f"{name}.act returned a value that is not finite: nothing is sent to the joints")
        return np.clip(chunk, self._joints.position_min_rad, self._joints.position_max_rad)

    def _play(self) -> None:
        """Publishes the next action; drops what was planned on observations that have become stale."""
        if self._model is None or self._observer.missing():
            self._started = self._started and self._model is not None  # no gap while it is unloaded
            self._player.clear()
            return
        action = self._player.step()
        self._periods += self._started
        if action is None:
            self._gaps += self._started
            return
        self._started = True
        now_ns = self.context.now_ns()
        message = joint_state(self._joints.names, action, frame_id=self.context.spec.frame_id, at_ns=now_ns)
        self._outputs.publish(now_ns, lambda _: message)


def joint_space(joints: Sequence[JointRange]) -> JointSpace:
    """Makes a JointSpace of the joints of the plan."""
    return JointSpace(
        names=tuple(joint.name for joint in joints),
        position_min_rad=np.array([joint.min_rad for joint in joints], np.float64),
        position_max_rad=np.array([joint.max_rad for joint in joints], np.float64),
    )
