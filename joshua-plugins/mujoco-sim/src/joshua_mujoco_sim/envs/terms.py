"""Named terms: what an environment observes, rewards, ends at, and starts from.

A term is a small function over a ``State`` of N simulations, with a name and parameters. A task is a list of
them, so that a trainer changes a reward by a weight, and an ablation removes a line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from gymnasium import spaces
from joshua.features import ACTION, Feature, FeatureSet

from joshua_mujoco_sim.envs.state import FloatArray, IntArray, State

Generators = Sequence[np.random.Generator]


@dataclass(frozen=True)
class ObservationTerm:
    """One part of the observation: ``function(state, **parameters)`` gives shape (N, k).

    Attributes:
        name: of the feature, such as ``state`` for ``observation.state``.
        unit: of its numbers; joints: those that it shows, if it has a number for each.
    """

    name: str
    function: Callable[..., FloatArray]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unit: str = ""
    joints: slice | None = None


@dataclass(frozen=True)
class RewardTerm:
    """One part of the reward: ``weight`` times ``function(state, **parameters)``, shape (N,)."""

    name: str
    function: Callable[..., FloatArray]
    weight: float = 1.0
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TerminationTerm:
    """One reason to end an episode: ``function(state, **parameters)`` gives booleans, shape (N,).

    Attributes:
        success: the task was done, which ``info["is_success"]`` says.
    """

    name: str
    function: Callable[..., Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    success: bool = False


@dataclass(frozen=True)
class ResetTerm:
    """One part of the start: ``function(state, ids, generators, **parameters)`` writes some simulations.

    ``generators`` has one random generator for each of ``ids``, so that an episode depends on its own seed
    only, whatever runs beside it.
    """

    name: str
    function: Callable[..., None]
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """An environment as data.

    Attributes:
        model_path: packaged name or path of the model; frame_skip: physics steps of one action.
        action: turns ``state.action`` into controls, ``function(state)``; action_size: its length.
        prepare: called once with the state, to allocate what the terms keep in ``state.memory``.
        max_steps: length after which an episode is cut off.
        camera: that ``render`` shows.
    """

    model_path: str
    frame_skip: int
    action: Callable[[State], None]
    action_size: int
    observations: tuple[ObservationTerm, ...]
    rewards: tuple[RewardTerm, ...]
    terminations: tuple[TerminationTerm, ...]
    resets: tuple[ResetTerm, ...]
    max_steps: int
    camera: str
    prepare: Callable[[State], None] = lambda state: None

    def with_weights(self, weights: Mapping[str, float]) -> Task:
        """The same task with other weights of some reward terms; 0 takes a term out.

        Raises:
            KeyError: a name is no reward term; the message lists those that are.
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
    """Computes the terms of a task on a state.

    Args:
        task: the terms; state: what they look at.

    Attributes:
        features: of the observation, whose values stand side by side in it, and ``action``, in [-1, 1].
        observation_space, action_space: of one environment.
    """

    def __init__(self, task: Task, state: State) -> None:
        self._task = task
        self._state = state
        self._observe: list[Any] = []
        width = 0
        features = []
        joints = [state.model.joint(i).name for i in range(state.model.njnt)]
        for term in task.observations:
            size = term.function(state, **term.parameters).shape[1]
            self._observe.append((slice(width, width + size), term.function, dict(term.parameters)))
            width += size
            names = tuple(joints[term.joints]) if term.joints is not None else ()
            features.append(Feature(f"observation.{term.name}", "float32", (size,), names, term.unit))
        state.step_cache.clear()
        driven = tuple(state.model.actuator(i).name for i in range(state.model.nu))
        self.features = FeatureSet([*features, Feature(ACTION, "float32", (task.action_size,), driven)])
        self.observation_space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (task.action_size,), np.float32)
        self._reward = [(t.name, t.weight, t.function, dict(t.parameters)) for t in task.rewards]
        self._end = [(t.name, t.success, t.function, dict(t.parameters)) for t in task.terminations]

    def observation(self) -> Any:
        """All observation terms side by side, shape (N, K), float32."""
        state = self._state
        values = np.empty((state.count, *self.observation_space.shape), np.float32)
        for columns, function, parameters in self._observe:
            values[:, columns] = function(state, **parameters)
        return values

    def reward(self) -> tuple[FloatArray, dict[str, FloatArray]]:
        """The weighted sum, shape (N,), and each weighted term by name."""
        state = self._state
        total = np.zeros(state.count)
        terms = {}
        for name, weight, function, parameters in self._reward:
            terms[name] = value = weight * function(state, **parameters)
            total += value
        return total, terms

    def terminated(self) -> tuple[Any, Any, dict[str, Any]]:
        """Whether each episode ends, whether with success, and each reason by name; shape (N,)."""
        state = self._state
        ended = np.zeros(state.count, bool)
        success = np.zeros(state.count, bool)
        reasons = {}
        for name, is_success, function, parameters in self._end:
            reasons[name] = reason = function(state, **parameters)
            np.logical_or(ended, reason, out=ended)
            if is_success:
                success |= reason
        return ended, success, reasons

    def reset(self, ids: IntArray, generators: Generators) -> None:
        """Writes the start of some episodes."""
        for term in self._task.resets:
            term.function(self._state, ids, generators, **term.parameters)
