"""Many environments at once, stepped on all cores by MuJoCo's own threads. Needs MuJoCo 4."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from joshua_mujoco_sim.envs.single import make_task
from joshua_mujoco_sim.envs.state import BatchState, IntArray
from joshua_mujoco_sim.envs.terms import Evaluator, Task
from joshua_mujoco_sim.model_file import load_model


class TermVectorEnv(VectorEnv[Any, Any, Any]):
    """N environments of one task. Episodes that ended start anew with the next step, whose reward is 0.

    Each environment has a random generator of its own: with the seed s the k-th one runs the episodes of a
    single environment with the seed s + k.

    Args:
        task: makes the task; num_envs: N; threads: cores to use, 0 for all.
        max_episode_steps: length after which an episode is cut off; None for the task's.
        reward_function, weights, randomise: as for a single environment.
    """

    def __init__(
        self,
        task: Callable[..., Task],
        num_envs: int,
        *,
        max_episode_steps: int | None = None,
        threads: int = 0,
        reward_function: str = "",
        weights: Mapping[str, float] | None = None,
        randomise: bool = False,
    ) -> None:
        self.task = make_task(task, reward_function, weights, randomise)
        self._max_steps = max_episode_steps or self.task.max_steps
        model = load_model(self.task.model_path)
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}
        self.render_mode = None
        self._state = BatchState(model, num_envs, self.task.action_size, threads)
        self.task.prepare(self._state)
        self._evaluator = Evaluator(self.task, self._state)
        self._keyframe = model.key("home").id if model.nkey else -1
        self._generators = [np.random.default_rng() for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, bool)
        self._reset(np.arange(num_envs))
        self.features = self._evaluator.features
        self.single_action_space = self._evaluator.action_space
        self.single_observation_space = self._evaluator.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @property
    def state(self) -> BatchState:
        """The simulations, for tests and for own terms."""
        return self._state

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts all episodes."""
        if seed is not None:
            seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, int) else seed
            for index, value in enumerate(seeds):
                if value is not None:
                    self._generators[index] = np.random.Generator(np.random.PCG64(value))
        self._reset(np.arange(self.num_envs))
        self._ended[:] = False
        return self._evaluator.observation(), {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Does one action in each environment, shape (N, A)."""
        state, evaluator = self._state, self._evaluator
        state.last_action[:] = state.action
        np.clip(actions, -1.0, 1.0, out=state.action)
        if not np.isfinite(state.action).all():
            raise ValueError("an action is not finite")
        self.task.action(state)
        state.step(self.task.frame_skip)
        state.elapsed_steps += 1
        reward, terms = evaluator.reward()
        ended, success, _ = evaluator.terminated()
        fresh = self._ended
        if fresh.any():
            ids = np.flatnonzero(fresh)
            self._reset(ids)
            reward[ids] = 0.0
            ended[ids] = success[ids] = False
        truncated = (state.elapsed_steps >= self._max_steps) & ~ended
        self._ended = ended | truncated
        info = {"reward_terms": terms, "is_success": success}
        return evaluator.observation(), reward, ended, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing is left open."""

    def _reset(self, ids: IntArray) -> None:
        state = self._state
        state.reset(ids, self._keyframe)
        state.action[ids] = state.last_action[ids] = 0.0
        state.elapsed_steps[ids] = 0
        self._evaluator.reset(ids, [self._generators[index] for index in ids])
        state.forward(ids)
