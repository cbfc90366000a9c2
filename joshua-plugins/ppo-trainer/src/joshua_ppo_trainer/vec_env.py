"""Batched environments for stable-baselines3: arrays, without a dictionary for each environment."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from joshua_ppo_trainer.normalise import Normaliser, Unapplied

#: Episodes over which success, return and length are averaged.
WINDOW = 200

#: Info of an environment whose episode continues: one shared dictionary, never written to.
_NOTHING: dict[str, Any] = {}


class BatchedVecEnv(VecEnv):  # type: ignore[misc,unused-ignore]
    """N environments that step together and restart in the step that ends their episode.

    Args:
        environment: has ``advance``, see ``joshua_mujoco_sim.envs.TermVectorEnv``, in the mode SAME_STEP.
        normaliser: of observations and rewards; ``Unapplied`` for those of the environment.

    Attributes:
        episodes: of the last episodes, (return, length, success); done: total number of ended episodes.
    """

    def __init__(self, environment: Any, normaliser: Normaliser | Unapplied) -> None:
        self.environment, self.normaliser = environment, normaliser
        count = environment.num_envs
        super().__init__(count, environment.single_observation_space, environment.single_action_space)
        self.episodes: deque[tuple[float, int, bool]] = deque(maxlen=WINDOW)
        self.done = 0
        self.returns, self.lengths = np.zeros(count), np.zeros(count, np.int64)
        self._actions: Any = None

    def reset(self) -> Any:
        """Start all episodes."""
        observations, _ = self.environment.reset()
        self.returns[:] = 0.0
        self.lengths[:] = 0
        return self.normaliser.observation(observations)

    def step_async(self, actions: Any) -> None:
        """Store the actions of a step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Execute the step."""
        step = self.environment.advance(self._actions)
        over = step.terminated | step.truncated
        self.returns += step.rewards
        self.lengths += 1
        infos = [_NOTHING] * self.num_envs
        if step.final:
            for index, final in step.final.items():
                infos[index] = {
                    "terminal_observation": self.normaliser.shown(final),
                    "TimeLimit.truncated": bool(step.truncated[index]),
                }
                self.episodes.append(
                    (float(self.returns[index]), int(self.lengths[index]), bool(step.success[index]))
                )
            self.done += len(step.final)
            self.returns[over] = 0.0
            self.lengths[over] = 0
        rewards = self.normaliser.reward(step.rewards, over)
        return self.normaliser.observation(step.observations), rewards, over, infos

    def close(self) -> None:
        """Close the environments."""
        self.environment.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute that all environments share, once for each."""
        return [getattr(self.environment, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: environments are configured where they are made."""
        raise NotImplementedError("an environment of a batch cannot be changed by itself")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse: environments of a batch have no methods of their own."""
        raise NotImplementedError("an environment of a batch has no methods of its own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each: no environment is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Keep the seeds: the environments were seeded where they were made."""
        return [None] * self.num_envs
