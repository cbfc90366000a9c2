"""Named terms: what an environment observes, rewards, ends at, and starts from.

A term is a small pure function over a ``State`` of N simulations, with name and parameters. A task is a list
of terms, so that a trainer changes a reward by a weight, and an ablation removes a line. Terms compute with
the array module of the state, and so does ``Evaluator`` in ``observed``, ``controlled``, ``rewarded``,
``judged`` and ``begun``: the same task runs with NumPy and is traced by JAX.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces
from joshua.features import ACTION, Feature, FeatureSet

from joshua_mujoco_sim.envs.starts import Draws, GeneratorDraws, Start
from joshua_mujoco_sim.envs.state import FloatArray, IntArray, Simulations, State

Generators = Sequence[np.random.Generator]

#: A constant, or one that the model gives.
Constant = float | Callable[[mujoco.MjModel], FloatArray]


@dataclass(frozen=True)
class ObservationTerm:
    """One part of the observation: ``function(state, **parameters)`` gives shape (N, k).

    Attributes:
        name: of the feature, such as ``state`` for ``observation.state``.
        unit: of its numbers; joints: those that it shows, if it has a number for each.
        offset, scale: constants that bring its numbers to about ±1: an environment shows
            ``(value - offset) / scale``.
    """

    name: str
    function: Callable[..., Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unit: str = ""
    joints: slice | None = None
    offset: Constant = 0.0
    scale: Constant = 1.0


@dataclass(frozen=True)
class RewardTerm:
    """One part of the reward: ``weight`` times ``function(state, **parameters)``, shape (N,).

    Attributes:
        potential: the reward of a step is the change of the function in it. The sum over an episode is then
            that of its end less that of its start, however long the episode lasts and whatever way it takes
            (shaping by a potential, Ng et al. 1999, for a return without discount).
    """

    name: str
    function: Callable[..., Any]
    weight: float = 1.0
    parameters: Mapping[str, Any] = field(default_factory=dict)
    potential: bool = False


@dataclass(frozen=True)
class TerminationTerm:
    """One reason to end an episode: ``function(state, **parameters)`` gives booleans, shape (N,).

    Attributes:
        success: the task was done, which ``info["is_success"]`` says.
        failure: the simulation itself failed. The step is worth nothing then, its observation and objects are
            zeros, and no other reason holds. MuJoCo does not restart such a simulation by itself.
    """

    name: str
    function: Callable[..., Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    success: bool = False
    failure: bool = False


@dataclass(frozen=True)
class ResetTerm:
    """One part of the start: ``function(start, draws, **parameters)`` gives a changed ``Start``.

    It is pure, so that it serves NumPy and JAX.
    """

    name: str
    function: Callable[..., Start]
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ActionMode:
    """What an action means: ``function(state)`` gives the controls, shape (N, nu).

    Attributes:
        low, high: of the action space; start: the action that stands for doing nothing at a start, from the
            state, None for zeros; unit: of an action.
        shown: fields of observation terms that this mode changes, such as scales, by name of the term.
    """

    function: Callable[[State], Any]
    low: Constant = -1.0
    high: Constant = 1.0
    start: Callable[[State], Any] | None = None
    unit: str = ""
    shown: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """An environment as data.

    Attributes:
        model_path: packaged name or path of the model; frame_skip: physics steps of one action.
        actions: what an action can mean, by name, the default first; action_size: its length.
        max_steps: length after which an episode is cut off.
        camera: that ``render`` shows.
        keyframe: that an episode starts from; "" for the model's own default.
        randomisation: resets that ``randomise=True`` adds; () if the task has none.
        objects: what ``info["objects"]`` shows, by name, ``function(state)`` giving shape (N, k).
        forces: terms read ``state.contact_forces``, which costs time.
        prepare: called once with the state, to allocate what own terms keep in ``state.memory``.
    """

    model_path: str
    frame_skip: int
    actions: Mapping[str, ActionMode]
    action_size: int
    observations: tuple[ObservationTerm, ...]
    rewards: tuple[RewardTerm, ...]
    terminations: tuple[TerminationTerm, ...]
    resets: tuple[ResetTerm, ...]
    max_steps: int
    camera: str
    keyframe: str = "home"
    randomisation: tuple[ResetTerm, ...] = ()
    objects: Mapping[str, Callable[[State], Any]] = field(default_factory=dict)
    forces: bool = False
    prepare: Callable[[State], None] = lambda state: None

    @property
    def judges_success(self) -> bool:
        """Whether an episode can end with success."""
        return any(term.success for term in self.terminations)

    def with_weights(self, weights: Mapping[str, float]) -> Task:
        """The same task with other weights of some reward terms; 0 takes a term out.

        Raises:
            KeyError: a name is no reward term. The message lists those that are.
        """
        known = [term.name for term in self.rewards]
        unknown = sorted(set(weights) - set(known))
        if unknown:
            raise KeyError(f"no reward term {', '.join(unknown)}: the task has {', '.join(known)}")
        terms = (replace(term, weight=weights.get(term.name, term.weight)) for term in self.rewards)
        return replace(self, rewards=tuple(term for term in terms if term.weight))

    def with_resets(self, *terms: ResetTerm) -> Task:
        """The same task with more of a start, such as randomised physics."""
        return replace(self, resets=(*self.resets, *terms))


class Evaluator:
    """Computes the terms of a task on a state, and what an action does to it.

    Args:
        task: the terms; state: what they look at, and what resets write.
        action_mode: one of the task's; "" for its default.

    Raises:
        ValueError: the task has no such action mode; lists those that it has.

    Attributes:
        features: of the observation, whose values stand side by side in it, and of ``action``, with units.
        offset, scale: of the numbers of an observation, which shows ``(value - offset) / scale``.
        observation_space, action_space: of one environment.
        potentials: what each reward by a potential was at the end of the last step, shape (N,).
    """

    def __init__(self, task: Task, state: Simulations, action_mode: str = "") -> None:
        self._task = task
        self._state = state
        name = action_mode or next(iter(task.actions))
        if name not in task.actions:
            raise ValueError(
                f"{task.model_path} has no action mode {name!r}: choose {' or '.join(task.actions)}"
            )
        self._mode = task.actions[name]
        observations = [replace(term, **self._mode.shown.get(term.name, {})) for term in task.observations]
        self._observe = [(term.function, dict(term.parameters)) for term in observations]
        width = 0
        features, offsets, scales = [], [], []
        model = state.model
        joints = [model.joint(i).name for i in range(model.njnt)]
        for term in observations:
            size = term.function(state, **term.parameters).shape[1]
            width += size
            names = tuple(joints[term.joints]) if term.joints is not None else ()
            features.append(Feature(f"observation.{term.name}", "float32", (size,), names, term.unit))
            offsets.append(_resolved(term.offset, model, size))
            scales.append(_resolved(term.scale, model, size))
        state.step_cache.clear()
        driven = tuple(model.actuator(i).name for i in range(model.nu))
        action = Feature(ACTION, "float32", (task.action_size,), driven, self._mode.unit)
        self.features = FeatureSet([*features, action])
        self.offset, self.scale = np.concatenate(offsets), np.concatenate(scales)
        self.observation_space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        low, high = (_resolved(end, model, task.action_size) for end in (self._mode.low, self._mode.high))
        # rounded inwards, so that no action of the space leaves the range
        self.action_space = spaces.Box(_inwards(low, 1), _inwards(high, -1), dtype=np.float32)
        self._low, self._high = low, high
        self._reward = [(t.name, t.weight, t.function, dict(t.parameters)) for t in task.rewards]
        self.potentials = {
            term.name: np.zeros(state.count) for term in task.rewards if term.potential and term.weight
        }
        self._end = [(t.name, t.success, t.function, dict(t.parameters)) for t in task.terminations]
        self._failures = {t.name: (t.function, dict(t.parameters)) for t in task.terminations if t.failure}
        self._nominal: dict[str, Any] = {}

    def act(self, actions: Any) -> None:
        """Take the actions of a step, shape (N, A), and write the controls.

        Raises:
            ValueError: they have another shape or are not finite; nothing is stored then.
        """
        state = self._state
        wanted = np.asarray(actions, np.float64)
        if wanted.shape != state.action.shape:
            one = self.action_space.shape
            raise ValueError(f"actions have the shape {wanted.shape[1:]}, not {one}")
        if not np.isfinite(wanted).all():
            bad = np.flatnonzero(~np.isfinite(wanted).all(axis=1))
            raise ValueError(f"the action {wanted[bad[0]]} of environment {bad[0]} is not finite")
        state.last_action[:] = state.action
        np.clip(wanted, self._low, self._high, out=state.action)
        state.ctrl[:] = self._mode.function(state)

    def observation(self) -> Any:
        """All observation terms side by side, scaled, shape (N, K), float32."""
        failed = self._failed()
        with _quiet(failed):
            return _zeroed(self.observed(self._state), failed)

    def reward(self) -> tuple[FloatArray, dict[str, FloatArray]]:
        """The weighted sum, shape (N,), and each weighted term by name."""
        failed = self._failed()
        with _quiet(failed):
            total, terms, potentials = self.rewarded(self._state, self.potentials)
        for name, values in potentials.items():
            self.potentials[name] = np.array(values)
        return _zeroed(total, failed), {name: _zeroed(values, failed) for name, values in terms.items()}

    def terminated(self) -> tuple[Any, Any, dict[str, Any]]:
        """Whether each episode ends, whether with success, and each reason by name; shape (N,)."""
        failed = self._failed()
        with _quiet(failed):
            ended, success, reasons = self.judged(self._state)
        others = {name: _zeroed(reasons[name], failed) for name in reasons if name not in self._failures}
        return ended, _zeroed(success, failed), reasons | others

    def objects(self) -> dict[str, Any]:
        """The state of each object, by name, shape (N, k)."""
        failed, objects = self._failed(), self._task.objects
        return {name: _zeroed(np.array(show(self._state)), failed) for name, show in objects.items()}

    def reset(self, ids: IntArray, generators: Generators) -> None:
        """Start some episodes."""
        state = self._state
        state.reset(ids, self.keyframe)
        state.elapsed_steps[ids] = 0
        fresh = Start(
            np, state.model, state.qpos[ids], state.qvel[ids], state.mocap_pos[ids], self._nominal_of
        )
        begun = self.begun(fresh, GeneratorDraws(generators))
        state.qpos[ids], state.qvel[ids], state.mocap_pos[ids] = begun.qpos, begun.qvel, begun.mocap_pos
        for field_name, values in begun.parameters.items():
            state.parameter(field_name)[ids] = values
        state.action[ids] = state.last_action[ids] = self.first_action(state)[ids]
        state.forward(ids)
        for name, values in self.potentials_of(state).items():
            self.potentials[name][ids] = values[ids]

    # From here on pure: for states of NumPy and of JAX.

    @property
    def keyframe(self) -> int:
        """Index of the keyframe that episodes start from; -1 for the model's default."""
        name = self._task.keyframe
        return int(self._state.model.key(name).id) if name else -1

    def limited(self, actions: Any, xp: Any) -> Any:
        """Return actions within the limits of their space, shape (N, A)."""
        return xp.clip(actions, self._low, self._high)

    def controlled(self, state: State) -> Any:
        """Return the controls of the actions of a state, shape (N, nu)."""
        return self._mode.function(state)

    def observed(self, state: State) -> Any:
        """Return the observation of a state, scaled, shape (N, K), float32."""
        parts = [function(state, **parameters) for function, parameters in self._observe]
        values = state.xp.concatenate(parts, axis=1)
        return ((values - self.offset) / self.scale).astype(np.float32)

    def rewarded(
        self, state: State, potentials: Mapping[str, Any]
    ) -> tuple[Any, dict[str, Any], dict[str, Any]]:
        """Return the sum of the rewards, shape (N,), each weighted term, and the new potentials."""
        total = state.xp.zeros(state.count)
        terms, following = {}, {}
        for name, weight, function, parameters in self._reward:
            value = function(state, **parameters)
            if name in potentials:
                following[name] = value
                value = value - potentials[name]
            terms[name] = value = weight * value
            total = total + value
        return total, terms, following

    def judged(self, state: State) -> tuple[Any, Any, dict[str, Any]]:
        """Return whether each episode ends, whether with success, and each reason by name; shape (N,)."""
        ended = success = state.xp.zeros(state.count, bool)
        reasons = {}
        for name, is_success, function, parameters in self._end:
            reasons[name] = reason = function(state, **parameters)
            ended = ended | reason
            if is_success:
                success = success | reason
        return ended, success, reasons

    def begun(self, start: Start, draws: Draws) -> Start:
        """Return how episodes start, from the keyframe, by the task's terms."""
        for term in self._task.resets:
            start = term.function(start, draws, **term.parameters)
        return start

    def first_action(self, state: State) -> Any:
        """Return the action that stands for doing nothing at a start, shape (N, A)."""
        return self._mode.start(state) if self._mode.start else state.xp.zeros_like(state.action)

    def potentials_of(self, state: State) -> dict[str, Any]:
        """Return each reward by a potential as it is in a state, shape (N,)."""
        return {
            name: function(state, **parameters)
            for name, _, function, parameters in self._reward
            if name in self.potentials
        }

    def _failed(self) -> Any:
        """Return in which simulations a failure holds, shape (N,); None where it does in none."""
        failed = None
        for function, parameters in self._failures.values():
            found = function(self._state, **parameters)
            failed = found if failed is None else failed | found
        return failed if failed is not None and failed.any() else None

    def _nominal_of(self, field_name: str) -> Any:
        found = self._nominal.get(field_name)
        if found is None:
            found = self._nominal[field_name] = np.array(self._state.parameter(field_name)[0])
        return found


def _quiet(failed: Any) -> Any:
    """Return a context in which the numbers of failed simulations cause no warnings."""
    return nullcontext() if failed is None else np.errstate(over="ignore", invalid="ignore")


def _zeroed(values: Any, failed: Any) -> Any:
    """Return values, shape (N, …), with zeros for failed simulations."""
    if failed is None:
        return values
    kept = np.array(values)
    kept[failed] = 0
    return kept


def _resolved(constant: Constant, model: mujoco.MjModel, size: int) -> FloatArray:
    value = constant(model) if callable(constant) else constant
    return np.array(np.broadcast_to(np.asarray(value, np.float64), (size,)))


def _inwards(ends: FloatArray, direction: int) -> Any:
    """The nearest float32 that is not outside."""
    near = ends.astype(np.float32)
    outside = near < ends if direction > 0 else near > ends
    return np.where(outside, np.nextafter(near, np.float32(direction * np.inf)), near)
