"""The node of a model: observations in, actions out at the publisher's rate.

Why one file: life cycle, verbs and the thread of the model share one state.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from joshua.api import (
    JointRange,
    JointSpace,
    Model,
    ModelError,
    NodeContext,
    Observation,
    RefusedError,
    verb,
)
from joshua.api.models import ModelSettings
from joshua.api.nodes import (
    ModelFacts,
    NodeBehaviour,
    NodeError,
    TopicSpec,
    TrafficFigures,
    load_implementation,
)
from joshua.features import FeatureSet
from joshua.features.needs import as_trained, joined, unmet
from joshua.messages import MessageError, message_class
from joshua.messages.arrays import COMPRESSED_IMAGE, holds_numbers, load_decoder

from joshua_inference.commands import Commands
from joshua_inference.figures import InferenceFigures
from joshua_inference.loop import InferenceLoop
from joshua_inference.observer import Observer, UnfitMessageError
from joshua_inference.priority import stand_back, threads_stand_back

JOINT_STATE = "sensor_msgs/msg/JointState"
DIAGNOSTIC = "diagnostic_msgs/msg/DiagnosticStatus"

#: Share of periods without an action that still counts as keeping up.
GAPS_MAX = 0.05

#: Longest wait of the model's thread before it checks for a stop.
WAIT_S = 0.2

#: Interval at which a blocked model checks whether it may run again.
BLOCKED_S = 0.01

#: Interval between two texts in the status line.
SHOWN_S = 0.5

#: Time beyond the chunk timeout until a model that does not return is killed.
HANG_MARGIN_S = 5.0

#: Most characters of a task, which any node of the graph may set.
TASK_MAX = 2000

#: Longest time that a thread keeps the interpreter while another waits for it, seconds.
_SWITCH_S = 0.001

_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class TaskRequest:
    """Task of the robot, in plain words."""

    text: str


@dataclass(frozen=True)
class EpisodeEnd:
    """Whether the task has succeeded."""

    success: bool


@dataclass(frozen=True)
class Weights:
    """Folder or file of weights."""

    path: str


class InferenceNode(NodeBehaviour):
    """The standard behaviour of models.

    A thread runs the model whenever a chunk of actions is wanted; a timer at the publisher's rate plays the
    chunks. While a topic is stale, a task is missing, or a person has taken over, the arm ramps to a
    stop and then nothing is published, so that the actuator's own watchdog holds it.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._facts = facts = context.spec.facts_as(ModelFacts)
        self._model: Model | None = None
        self._ranges = tuple(facts.joints)
        self._joints = joint_space(self._ranges)
        self._rate_hz = max((topic.rate_hz for topic in context.spec.publishers), default=0.0)
        self._acting = threading.Lock()
        self._stands_back = threading.Event()
        self._loop = InferenceLoop(facts.execution, self._joints, 1 / (self._rate_hz or 1.0), context.now_ns)
        self._features = FeatureSet(facts.features)
        self._observer = Observer(
            self._features, facts.execution.observation_max_age_s, facts.task, context.now_ns, facts.arms
        )
        self._commands = Commands()
        self._received: list[TrafficFigures] = []
        self._runs = self._resets = False
        self._weights = ""  # those of the file
        self._failed = facts.restarted
        self._taken_over: set[str] = set()
        self._waits_for = ""
        self._ticks = 0
        self._said: deque[str] = deque(maxlen=16)
        self._reported_outside: set[str] = set()
        self._reports: Any = None
        self._took_s: deque[float] = deque(maxlen=10_000)

    def configure(self) -> None:
        """Load the model and declare topics. Raises ModelError, TargetError."""
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
                f"{spec.full_name} has no known joints: let an actuator subscribe to "
                f"{spec.publishers[0].name}"
            )
        for topic in spec.subscriptions:
            if not holds_numbers(topic.type_name):
                raise ModelError(
                    f"{spec.full_name} cannot observe {topic.type_name} on {topic.name}: it contains no "
                    "numbers"
                )
            if topic.type_name == COMPRESSED_IMAGE:
                try:
                    load_decoder()
                except MessageError as error:
                    raise ModelError(f"{spec.full_name}: {error}") from error
        with threads_stand_back():
            if self._facts.awaits_weights:
                self._import_libraries()
            else:
                self._model = self._loaded()
        publishers = [self.context.publisher(topic) for topic in spec.publishers]
        self._commands = Commands(publishers, self._rate_hz, self._facts.arms)
        self._commands.use(self._joints.names)
        self._received = [
            self.context.subscribe(topic, partial(self._observer.add, topic.name))
            for topic in spec.subscriptions
        ]
        if self._facts.is_judged:
            self._loop.pause()
            self._reports = self.context.publisher(TopicSpec(name="~/episode", type_name=DIAGNOSTIC))
        for name in self._facts.interventions:
            topic = TopicSpec(name=name, type_name="std_msgs/msg/Bool")
            self.context.subscribe(topic, partial(self._intervened, name))

    def verb_providers(self) -> tuple[object, ...]:
        """Return the node's own verbs and those of its model."""
        return (self,) if self._model is None else (self, self._model)

    @verb(moves=True, runs="beside")
    def load(self) -> str:
        """Load the model, which then acts again."""
        name = self.context.spec.full_name
        if self._model is not None:
            raise RefusedError(f"{name} has already loaded its model: unload it first")
        self._load()
        return f"{name}: the model is loaded"

    @verb(moves=True, runs="beside")
    def use_weights(self, request: Weights) -> str:
        """Load other weights for an evaluation; the arm holds until an episode begins."""
        name = self.context.spec.full_name
        if not self._facts.is_judged:
            raise RefusedError(f"{name} keeps the weights of its file: only an evaluation replaces them")
        self._loop.pause()
        with self._acting:  # the model has finished its present computation
            model, self._model = self._model, None
            self._loop.clear(output=True)
        if model is not None:
            model.close()
        self._weights = request.path
        self._load()
        return f"{name}: the weights are loaded; the arm holds until an episode begins"

    def _load(self) -> None:
        name = self.context.spec.full_name
        try:
            with threads_stand_back():
                model = self._loaded()
        except Exception as error:  # a plugin's code; the node continues without a model
            kind = "" if isinstance(error, (NodeError, ModelError)) else f"{type(error).__name__}: "
            raise RefusedError(f"{name}: the model was not loaded: {kind}{error}") from error
        if self.context.stopping:
            model.close()
            raise RefusedError(f"{name} stops")
        self.context.show("")
        self._model = model

    @verb(moves=False, runs="beside")
    def unload(self) -> str:
        """Unload the model; nothing is published, so the actuator holds its position."""
        name = self.context.spec.full_name
        with self._acting:  # the model has finished its present computation
            model, self._model = self._model, None
            self._loop.clear(output=True)
        if model is None:
            raise RefusedError(f"{name} has no model: load it first")
        model.close()
        self.context.show("no model")
        return f"{name}: the model is unloaded; the node publishes nothing"

    @verb(moves=False)
    def pause(self) -> str:
        """Ramp the arm to a stop and hold it."""
        self._loop.pause()
        return f"{self.context.spec.full_name} is paused; the arm holds"

    @verb(moves=True)
    def resume(self) -> str:
        """End a pause: the model acts again."""
        self._failed = False
        self._loop.resume()
        return f"{self.context.spec.full_name} acts again"

    @verb(moves=True)
    def step(self) -> str:
        """Execute one chunk, then hold again."""
        self._failed = False
        self._loop.single()
        return f"{self.context.spec.full_name} executes one chunk"

    @property
    def task_parameter(self) -> str:
        """Instruction that the model receives with each observation."""
        return self._observer.task

    @verb(moves=False, sets="task")
    def task(self, request: TaskRequest) -> str:
        """Tell the robot what to do, in plain words."""
        text = " ".join(request.text.split())
        if not text:
            raise RefusedError("the task is empty; to stop the model, run `joshua call NODE pause`")
        if len(text) > TASK_MAX:
            raise RefusedError(f"the task has {len(text)} characters; {TASK_MAX} are allowed")
        self._observer.task = text
        self._loop.hurry()
        return f"{self.context.spec.full_name}: the task is: {text}"

    @verb(moves=True)
    def begin_episode(self) -> str:
        """Begin an episode: the model forgets its history, and acts."""
        if self._model is None and self._facts.is_judged:
            raise RefusedError(
                f"{self.context.spec.full_name} has no weights: wait until its run asks for an episode"
            )
        self._resets, self._failed = True, False
        self._took_s.clear()
        self._report("begin", self._loop.figures().episodes + 1)
        self._loop.resume()
        return f"{self.context.spec.full_name}: the episode begins"

    @verb(moves=False)
    def end_episode(self, request: EpisodeEnd) -> str:
        """End an episode and mark its success; the arm holds."""
        number = self._loop.end_episode(request.success)
        self._report("success" if request.success else "failure", number)
        mark = "succeeded" if request.success else "failed"
        return f"{self.context.spec.full_name}: episode {number} {mark}; the arm holds"

    def _report(self, what: str, number: int) -> None:
        """Publish the begin or the mark of an episode, for an evaluation on the robot."""
        if self._reports is None:
            return
        status, pair = message_class(DIAGNOSTIC), message_class("diagnostic_msgs/msg/KeyValue")
        took_ms = 1e3 * float(np.median(self._took_s)) if self._took_s else 0.0
        values = {"number": str(number), "inference_latency_ms": f"{took_ms:.6g}"}
        name = self.context.spec.full_name
        pairs = [pair(key=key, value=value) for key, value in values.items()]
        self._reports.publish(status(level=0, name=name, message=what, hardware_id="", values=pairs))

    @verb(moves=False)
    def figures(self) -> InferenceFigures:
        """Report rate, queue, latencies, ages, skipped steps, borders of chunks, and episodes."""
        return replace(self._loop.figures(), state=self._state() or "acts")

    def activate(self) -> None:
        """Start the model's thread and the timer of the actions."""
        if self._runs:
            return
        self._runs = True
        if self._facts.restarted:
            name = self.context.spec.full_name
            self._loop.pause()
            self.context.warn(
                f"{name} failed and was restarted. It is paused and the arm holds. Find the reason "
                f"above, then run `joshua call {name} resume`"
            )
        hang_after_s = self._facts.execution.chunk_timeout_s + HANG_MARGIN_S
        sys.setswitchinterval(_SWITCH_S)
        self.context.spawn_thread(self._infer, name="model", hang_after_s=hang_after_s)
        self._stands_back.wait(WAIT_S)  # before this process gets the priority of a control loop
        self.context.create_timer(1 / self._rate_hz, self._play, name="actions")

    def deactivate(self) -> None:
        """Stop publishing actions."""
        figures = self._loop.figures()
        self._loop.clear(output=True)
        if self._runs and figures.chunks:
            self.context.log.info("%d chunks: %s", figures.chunks, figures)
        self._runs = False

    def cleanup(self) -> None:
        """Free the model."""
        if self._model is not None:
            self._model.close()

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the rates of actions and observations, and whether the model kept up."""
        rows = self._commands.checks()
        for item in self._received:
            measured = f"{item.count} at {item.rate_hz:.4g} Hz"
            rows.append((f"observations on {item.topic.name}", item.count > 0, measured))
        found = self._loop.figures()
        kept_up = found.chunks > 0 and found.gaps <= GAPS_MAX * found.periods
        measured = f"{found.chunks} chunks, {found.gaps} of {found.periods} periods without an action"
        rows.append(("model keeps up", kept_up, measured))
        return rows

    def _infer(self) -> None:
        """Run the model until the stop; any exception that it raises fails the node."""
        stand_back()
        self._stands_back.set()
        while not self.context.stopping:
            if self._blocked():
                time.sleep(BLOCKED_S)
                continue
            if not self._loop.wait(WAIT_S) or self._blocked():
                continue
            began_ns = time.monotonic_ns()
            try:
                observation = self._observer.observation()
            except UnfitMessageError as error:
                self._say_once(str(error))
                continue
            with self._acting:
                if (model := self._model) is not None:
                    self._predict(model, observation, began_ns)

    def _predict(self, model: Model, observation: Observation, began_ns: int) -> None:
        if self._resets:
            self._resets = False
            model.reset()
            self._observer.forget()
        late = self._loop.predict(model, observation, began_ns)
        self._report_outside()
        self._took_s.append(self._loop.took_s)
        age_s = (self.context.now_ns() - observation.stamp_ns) / 1e9
        if late and self._loop.figures().queue == 0:
            self._say_once(
                f"every step of a chunk was late: its observation was {age_s:.2f} s old on arrival. Use a "
                "faster device or longer chunks. If the observation comes from another machine, "
                "synchronise the clocks"
            )

    def _report_outside(self) -> None:
        """Warn once of each joint that the model commands far outside its limits."""
        joints = self._joints
        for name, position_rad in self._loop.outside.items():
            if name in self._reported_outside:
                continue
            self._reported_outside.add(name)
            index = joints.names.index(name)
            self.context.log.warning(
                "the model commands %s to %.4g rad, its limits are %.4g to %.4g rad: the joint stays within "
                "its limits. Check that the model was trained on this robot, in these units",
                name,
                position_rad,
                joints.position_min_rad[index],
                joints.position_max_rad[index],
            )

    def _import_libraries(self) -> None:
        """Import what the model needs before the node's threads run.

        The import of a large library keeps every other thread of the process from running for seconds. Once
        the node is active, that is taken for a hang.
        """
        self._limit_threads()
        _, settings = load_implementation(self.context.spec, Model)
        if isinstance(settings, ModelSettings):
            for library in settings.needs().libraries:
                importlib.import_module(library)

    def _limit_threads(self) -> None:
        """Let numeric libraries use as many threads as the file says; they read it when they are imported."""
        threads = self._facts.compute.threads or os.cpu_count()
        for variable in _THREADS:
            os.environ[variable] = str(threads)

    def _loaded(self) -> Model:
        name, compute = self.context.spec.full_name, self._facts.compute
        self._limit_threads()
        implementation, settings = load_implementation(self.context.spec, Model)
        if self._weights and settings is not None:
            settings = settings.model_copy(update={"weights": self._weights})
        model: Model = implementation(settings, self._joints, self._features)
        try:
            model.load()
            whole = joined(model.needs(), self._features, self._facts.arms)
            features, joints = as_trained(model.needs(), whole, self._ranges)
            if joints != self._ranges or whole is not self._features:  # the plan did not have the checkpoint
                self._use(features, joints)
                model.close()
                model = implementation(settings, self._joints, self._features)
                model.load()
            model.reset()
            strategy = self._facts.execution.strategy
            lacks = unmet(model.needs(), self._features, self._ranges, self._rate_hz, strategy)
            if lacks:
                raise ModelError("; ".join(f"{name}: {lack.message}. {lack.remedy}" for lack in lacks))
            self._observer.look_back(model.needs().history, 1 / (self._rate_hz or 1.0))
            self._warm_up(model, compute.warm_up)
        except BaseException:
            model.close()
            raise
        return model

    def _use(self, features: FeatureSet, joints: tuple[JointRange, ...]) -> None:
        """Use the joints in the order of the model; messages name them."""
        self._features, self._ranges, self._joints = features, joints, joint_space(joints)
        self._observer.use(features)
        self._loop.joints = self._joints
        self._commands.use(self._joints.names)

    def _warm_up(self, model: Model, chunks: int) -> None:
        """Run a chunk model on empty observations, so that its first real chunk is not slow."""
        values: dict[str, Any] = {}
        for feature in self._features.values():
            if 0 in feature.shape:
                return
            values[feature.key] = np.zeros(feature.shape, feature.dtype)
        now_ns, needs = self.context.now_ns(), model.needs()
        stamps_ns = dict.fromkeys(values, now_ns)
        for _ in range(chunks if needs.features is not None else 0):
            model.act(Observation(now_ns, values, stamps_ns, task=self._facts.task))
            model.reset()

    def _intervened(self, topic: str, message: Any, received_ns: int) -> None:
        """Note that a person takes over, or returns control: the model then starts again."""
        del received_ns
        if bool(message.data) is (topic in self._taken_over):
            return
        (self._taken_over.add if message.data else self._taken_over.discard)(topic)
        self._resets = True
        self._loop.clear(output=True)

    def _blocked(self) -> bool:
        """Return whether the model must not run; log the reason once."""
        missing = self._observer.missing()
        waits_for = f"a message on {', '.join(missing)}" if missing else ""
        if self._taken_over:
            waits_for = "control, which a person has taken over"
        elif not missing and self._facts.reads_task and not self._observer.task:
            waits_for = 'a task: run `joshua task "…"`'
        if waits_for != self._waits_for:
            self._waits_for = waits_for
            if waits_for:
                self.context.log.warning("waiting for %s", waits_for)
            else:
                self.context.log.info("all observations are up to date")
        return bool(waits_for) or self._model is None

    def _say_once(self, text: str) -> None:
        if text not in self._said:
            self._said.append(text)
            self.context.log.warning("%s", text)

    def _play(self) -> None:
        """Publish the action that is due, or the ramp into a hold."""
        model, waits = self._model, bool(self._waits_for or self._observer.missing())
        action = self._loop.tick(runs=model is not None and not waits, keep=not waits)
        if waits:
            self._loop.clear()
        self._ticks += 1
        if model is not None and self._ticks % max(1, round(SHOWN_S * self._rate_hz)) == 0:
            self._show()
        if action is None or model is None:
            return
        now_ns = self.context.now_ns()
        self._commands.publish(action, now_ns, self.context.spec.frame_id)

    def _show(self) -> None:
        """Show the figures in the status line; fail the node if the model does not return."""
        figures = self._loop.figures()
        state = self._state()
        self.context.show(state or str(figures) if figures.chunks else state)
        timeout_s = self._facts.execution.chunk_timeout_s
        if self._loop.computing_s > timeout_s:
            self.context.fail(
                f"the model has returned no chunk for {timeout_s:g} s. Give it a faster device, or raise "
                "execution.chunk_timeout_s"
            )

    def _state(self) -> str:
        """Return why the model does not act; "" while it does."""
        if self._model is None:
            return "no model"
        if self._failed and self._loop.paused:
            return f"failed and was restarted: run `joshua call {self.context.spec.full_name} resume`"
        return "paused" if self._loop.paused else f"waiting for {self._waits_for}" if self._waits_for else ""


def joint_space(joints: Sequence[JointRange]) -> JointSpace:
    """Make a JointSpace from the joints of the plan."""
    return JointSpace(
        names=tuple(joint.name for joint in joints),
        position_min_rad=np.array([joint.min_rad for joint in joints], np.float64),
        position_max_rad=np.array([joint.max_rad for joint in joints], np.float64),
    )
