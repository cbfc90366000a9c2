"""Play episodes: an environment, a policy, and the same starts for every policy."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from joshua.features import ACTION, IMAGES, FeatureSet
from joshua.tools import load_target

from joshua_evaluation.checkpoints import CheckpointError
from joshua_evaluation.metrics import SUCCESS, Episode

#: Size of videos if the policy itself sees no pictures.
VIDEO_SIZE = (320, 240)


class Arena:
    """Environment in which episodes are played, whichever plugin provides it.

    Args:
        make: import string of its factory; environment_id, reward_function: of the plan.
        options: further arguments, such as ``action_mode``.

    Attributes:
        features: of observations and actions; action_space; period_s: of a step.
        provided: what metrics can need of it.

    Raises:
        CheckpointError: it cannot be made with these options, or lacks a description.
    """

    def __init__(self, make: str, environment_id: str, reward_function: str, **options: Any) -> None:
        try:
            self._vector = load_target(make)(
                environment_id, reward_function=reward_function, num_envs=1, seed=None, **options
            )
        except (ValueError, TypeError) as error:
            asked = ", ".join(f"{name} {value}" for name, value in options.items()) or "its defaults"
            raise CheckpointError(
                f"{environment_id} cannot be made with {asked}: {error}", "Change what the message names"
            ) from error
        # MuJoCo 3 steps single environments in turn, which hold the description that a batched one has
        inner = self._vector
        if not hasattr(inner, "features") and getattr(inner, "envs", None):
            inner = inner.envs[0].unwrapped
        self._inner = inner
        self.features: FeatureSet = getattr(inner, "features", FeatureSet())
        judged = {SUCCESS} if getattr(inner, "judges_success", True) else set()
        self.provided = {*self.features, *judged}
        self.action_space = self._vector.single_action_space
        self.period_s = self._period_s()
        self._pictures: tuple[str, ...] = ()

    def reset(self, seed: int) -> Any:
        """Start the episode of a seed."""
        observation, _ = self._vector.reset(seed=[seed])
        return observation

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Execute one action, shape (A,)."""
        observation, rewards, terminated, truncated, info = self._vector.step(np.asarray(action)[None])
        return observation, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def numbers(self, observation: Any) -> Any:
        """Return the numbers of an observation as input of a trainer's policy, shape (1, K)."""
        return observation["state"] if isinstance(observation, dict) else observation

    def values(self, observation: Any) -> dict[str, Any]:
        """Return an observation by feature, in physical units, and its pictures by their key."""
        found: dict[str, Any] = {}
        physical = getattr(self._inner, "physical", None)
        if physical is not None:
            row, at = np.asarray(physical(self.numbers(observation)))[0], 0
            for feature in self.features.values():
                if feature.key != ACTION:
                    size = int(np.prod(feature.shape))
                    found[feature.key] = row[at : at + size].astype(np.float32)
                    at += size
        if isinstance(observation, dict):
            found |= {f"{IMAGES}{name}": value[0] for name, value in observation.items() if name != "state"}
        return found

    def close(self) -> None:
        """Close the environment. Idempotent."""
        vector, self._vector = self._vector, None
        if vector is not None:
            vector.close()

    def _period_s(self) -> float:
        state, task = getattr(self._inner, "state", None), getattr(self._inner, "task", None)
        if state is not None and task is not None:
            return float(state.model.opt.timestep * task.frame_skip)
        fps = float(getattr(self._inner, "metadata", {}).get("render_fps") or 0.0)
        return 1 / fps if fps else 1.0

    @property
    def camera(self) -> str:
        """Return the camera that suits the task; "" if none is known."""
        return str(getattr(getattr(self._inner, "task", None), "camera", ""))


class Player(Protocol):
    """Something that acts: a policy of a trainer, or a model."""

    #: Arguments for making its environment.
    options: dict[str, Any]

    def load(self, arena: Arena) -> None:
        """Prepare to act in an arena. Raises CheckpointError, ModelError, RunError."""

    def begin(self, seed: int) -> None:
        """Forget the previous episode, and draw the random numbers of the episode of a seed."""

    def act(self, arena: Arena, observation: Any, step: int) -> tuple[Any, float | None]:
        """Return the action of a step, and the policy's time in seconds, None if it did not compute."""

    def close(self) -> None:
        """Free what it has loaded."""


class Stopped(Exception):
    """The evaluation was stopped in the middle of an episode."""


def play(
    arena: Arena,
    player: Player,
    seed: int,
    asked: Callable[[], bool] = lambda: False,
    seen: Callable[[Any], None] = lambda observation: None,
) -> Episode:
    """Play one episode to its end.

    Args:
        asked: whether to stop; seen: called with each observation, the first and the last one included.

    Raises:
        Stopped: the run stops.
    """
    player.begin(seed)
    observation = arena.reset(seed)
    shown: list[dict[str, Any]] = [_numbers(arena.values(observation))]
    rewards: list[float] = []
    actions: list[Any] = []
    latencies: list[float] = []
    terms: dict[str, float] = {}
    seen(observation)
    while True:
        if asked():
            raise Stopped
        action, latency_s = player.act(arena, observation, len(rewards))
        if latency_s is not None:
            latencies.append(latency_s)
        observation, reward, terminated, truncated, info = arena.step(action)
        rewards.append(reward)
        actions.append(np.asarray(action, np.float64))
        shown.append(_numbers(arena.values(observation)))
        seen(observation)
        for name, value in (info.get("reward_terms") or {}).items():
            terms[name] = terms.get(name, 0.0) + float(np.asarray(value).reshape(-1)[0])
        if terminated or truncated:
            break
    success = info.get(SUCCESS)
    return Episode(
        seed=seed,
        success=bool(np.asarray(success).reshape(-1)[0]) if success is not None else None,
        truncated=truncated and not terminated,
        rewards=np.array(rewards),
        actions=np.array(actions),
        observations={key: np.array([row[key] for row in shown]) for key in shown[0]},
        latencies_s=np.array(latencies),
        period_s=arena.period_s,
        reward_terms=terms,
    )


def _numbers(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if not key.startswith(IMAGES)}


def ranked(episodes: Sequence[Episode]) -> list[int]:
    """Return the indices from the best to the worst: success first, then the return, then a quick success."""

    def rank(index: int) -> tuple[int, float, int, int]:
        one = episodes[index]
        won = bool(one.success)
        return -won, -float(one.rewards.sum()), won * one.steps, index

    return sorted(range(len(episodes)), key=rank)


def now_s() -> float:
    """Return the time of the clock for latencies."""
    return time.perf_counter()
