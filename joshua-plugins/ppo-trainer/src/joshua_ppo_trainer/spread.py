"""Rollouts on many workers. Each has some of the environments and a copy of the policy.

Workers collect whole rollouts: one message and one answer of each worker per iteration, whatever the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from joshua.tools import load_target
from joshua_jobs.executor import Executor, Stopped
from stable_baselines3.common.policies import ActorCriticPolicy

from joshua_ppo_trainer import checkpoint
from joshua_ppo_trainer.normalise import Normaliser
from joshua_ppo_trainer.vec_env import BatchedVecEnv

#: Number of environments of each worker, in a snapshot.
SIZES = "workers"

#: Prefix of what a worker keeps beside its environments, in a snapshot.
_OWN = "worker."


@dataclass(frozen=True)
class Share:
    """The part of one worker.

    Attributes:
        make, environment_id, reward_function: of the plan; randomise: of the settings.
        count: environments; seed: of the first one.
        network: keywords of the policy; gamma: of the learner; observations: whether they are normalised.
    """

    make: str
    environment_id: str
    reward_function: str
    randomise: bool
    count: int
    seed: int
    network: dict[str, Any]
    gamma: float
    observations: bool


@dataclass(frozen=True)
class Part:
    """What a worker collected: arrays of shape (steps, environments, …).

    Attributes:
        observations: before each step, not normalised; after: those after the last step.
        bootstraps: discounted values of the observations at which episodes were cut off, else 0.
        starts, over: whether an episode began before, and ended with the step.
        last_values: of the observations after the last step; episodes: (return, length, success).
        state: of the worker after the last step, by name.
    """

    observations: Any
    after: Any
    actions: Any
    rewards: Any
    bootstraps: Any
    values: Any
    log_probs: Any
    starts: Any
    over: Any
    last_values: Any
    episodes: list[tuple[float, int, bool]]
    state: dict[str, Any]


class Collector:
    """Environments and policy of a worker."""

    def __init__(self, share: Share) -> None:
        torch.set_num_threads(1)
        self._share = share
        made = self._environment = load_target(share.make)(
            share.environment_id,
            reward_function=share.reward_function,
            num_envs=share.count,
            seed=share.seed,
            threads=1,
            autoreset_mode="SameStep",
            **({"randomise": True} if share.randomise else {}),
        )
        self._observations, _ = made.reset(seed=share.seed)
        space = made.single_observation_space
        self._policy = ActorCriticPolicy(space, made.single_action_space, lambda _: 0.0, **share.network)
        self._policy.set_training_mode(False)
        self._normaliser = Normaliser(
            space.shape[0], share.count, share.gamma, observations=share.observations, rewards=False
        )
        self._starts = np.ones(share.count, bool)
        self._returns, self._lengths = np.zeros(share.count), np.zeros(share.count, np.int64)

    def collect(
        self,
        sent: tuple[dict[str, Any], dict[str, Any]],
        steps: int,
        seed: int,
        state: dict[str, Any] | None = None,
    ) -> Part:
        """Collect a rollout.

        Args:
            sent: weights of the policy, and moments of the observations; seed: of the actions.
            state: of a ``Part`` after which to continue; None to go on where this worker is.
        """
        if state is not None:
            self._restore(state)
        weights, moments = sent
        checkpoint.load_weights(self._policy, weights)
        self._normaliser.load(moments)
        torch.manual_seed(seed)
        space = self._environment.single_action_space
        rows: dict[str, list[Any]] = {
            name: []
            for name in (
                *("observations", "actions", "rewards", "bootstraps"),
                *("values", "log_probs", "starts", "over"),
            )
        }
        episodes: list[tuple[float, int, bool]] = []
        for _ in range(steps):
            actions, values, log_probs = self._act(self._observations)
            step = self._environment.advance(np.clip(actions, space.low, space.high))
            over = step.terminated | step.truncated
            bootstraps = np.zeros(self._share.count, np.float32)
            self._returns += step.rewards
            self._lengths += 1
            for index, final in (step.final or {}).items():
                if step.truncated[index]:
                    bootstraps[index] = self._share.gamma * self._value(final[None])[0]
                episodes.append(
                    (float(self._returns[index]), int(self._lengths[index]), bool(step.success[index]))
                )
            self._returns[over] = 0.0
            self._lengths[over] = 0
            found = (
                *(self._observations, actions, step.rewards, bootstraps),
                *(values, log_probs, self._starts, over),
            )
            for name, value in zip(rows, found, strict=True):
                rows[name].append(np.array(value))
            self._observations, self._starts = np.array(step.observations), over
        arrays = {name: np.stack(values) for name, values in rows.items()}
        last = self._value(self._observations)
        return Part(
            after=self._observations, last_values=last, episodes=episodes, state=self._state(), **arrays
        )

    def _state(self) -> dict[str, Any]:
        """Return all that the next rollout depends on, beside what the learner sends."""
        own = {
            "observations": self._observations,
            "starts": self._starts,
            "returns": self._returns,
            "lengths": self._lengths,
        }
        found: dict[str, Any] = self._environment.snapshot()
        return found | {f"{_OWN}{name}": np.array(values) for name, values in own.items()}

    def _restore(self, state: dict[str, Any]) -> None:
        self._environment.restore(state)
        self._observations, self._starts, self._returns, self._lengths = (
            np.array(state[f"{_OWN}{name}"]) for name in ("observations", "starts", "returns", "lengths")
        )

    def _act(self, observations: Any) -> tuple[Any, Any, Any]:
        with torch.no_grad():
            found = self._policy(torch.as_tensor(self._normaliser.shown(observations)))
        actions, values, log_probs = (item.numpy() for item in found)
        return actions, values.reshape(-1), log_probs

    def _value(self, observations: Any) -> Any:
        with torch.no_grad():
            seen = torch.as_tensor(self._normaliser.shown(observations))
            return self._policy.predict_values(seen).numpy().reshape(-1)


class SpreadEnvironment:
    """The environments of all workers together, as the learner sees them.

    Args:
        local: one environment of the same kind, for spaces and features.
        executor: provides the workers; shares: one for each; warn: told what differs in a continued run.
    """

    def __init__(
        self, local: Any, executor: Executor, shares: list[Share], warn: Callable[[str], None]
    ) -> None:
        self._local, self._executor, self._warn = local, executor, warn
        self.num_envs = sum(share.count for share in shares)
        self._sizes, self._seed = [share.count for share in shares], shares[0].seed
        self._crew = executor.crew(Collector, [(share,) for share in shares])
        #: Of the workers after the last rollout of all; None for fresh episodes.
        self._states: list[dict[str, Any] | None] = [None] * len(shares)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._local, name)

    @property
    def lost(self) -> int:
        """Rollouts that were collected again, because their workers were lost."""
        return self._executor.lost

    def collect(self, sent: Any, steps: int, iteration: int, stopping: Callable[[], bool]) -> list[Part]:
        """Collect a rollout in every worker; the random numbers depend on the iteration and on the worker.

        Each continues from the state that it is given, also in the place of a lost one, so nothing depends
        on losses.
        """
        shared = self._crew.share(sent)
        drawn = [np.random.SeedSequence([self._seed, iteration, index]) for index in range(len(self._sizes))]
        arguments = [
            (shared, steps, int(seed.generate_state(1)[0]), state)
            for seed, state in zip(drawn, self._states, strict=True)
        ]
        found: list[Part] = self._crew.each("collect", arguments, stopping)
        self._states = [part.state for part in found]
        return found

    def snapshot(self) -> dict[str, Any]:
        """Return the state of all environments after the last rollout, like that of environments here.

        The number of environments of each worker is with it; nothing before the first rollout.
        """
        states = [state for state in self._states if state is not None]
        if not states:
            return {}
        whole = {name: np.concatenate([state[name] for state in states]) for name in states[0]}
        return whole | {SIZES: np.array(self._sizes)}

    def restore(self, arrays: dict[str, Any]) -> None:
        """Restore a result of ``snapshot``. With other workers, the result is another one, which is said.

        Raises:
            ValueError: it belongs to another task or another number of environments.
        """
        if SIZES not in arrays:
            if arrays:
                self._warn(
                    "the run was not on a cluster before: its episodes start anew, and its result is not "
                    "that of an uninterrupted run"
                )
            return
        for name, values in self._local.snapshot().items():
            if name not in arrays or arrays[name].shape != (self.num_envs, *values.shape[1:]):
                raise ValueError(f"the saved environments do not fit: {name} is missing or of another shape")
        before, now = len(arrays[SIZES]), len(self._sizes)
        if before != now:
            self._warn(
                f"{now} workers continue what {before} began, so the result is not that of an uninterrupted "
                f"run. For the same result, continue with {before} workers (cluster.workers: {before}, and "
                "as many cores)"
            )
        ends = np.cumsum(self._sizes)
        self._states = [
            {name: values[end - size : end] for name, values in arrays.items() if name != SIZES}
            for size, end in zip(self._sizes, ends, strict=True)
        ]

    def close(self) -> None:
        """End the workers. Idempotent."""
        self._crew.close()
        self._executor.close()
        self._local.close()


class SpreadVecEnv(BatchedVecEnv):
    """Spaces for stable-baselines3, whose own collection is replaced by ``rollout``.

    Args:
        environment: that of the workers; normaliser: of observations and rewards.
    """

    def __init__(self, environment: SpreadEnvironment, normaliser: Normaliser) -> None:
        super().__init__(environment, normaliser)
        self._moments = normaliser

    def reset(self) -> Any:
        """Return zeros: the workers start their episodes themselves."""
        return np.zeros((self.num_envs, *self.observation_space.shape), np.float32)

    def rollout(self, model: Any, iteration: int, stopping: Callable[[], bool]) -> bool:
        """Fill the rollout buffer of PPO from the workers; return False if learning was stopped."""
        normaliser, buffer = self._moments, model.rollout_buffer
        sent = (checkpoint.weights_of(model.policy), normaliser.arrays())
        try:
            parts = self.environment.collect(sent, model.n_steps, iteration, stopping)
        except Stopped:
            return False
        whole = {name: np.concatenate([vars(part)[name] for part in parts], axis=1) for name in _BY_STEP}
        shown = normaliser.shown(whole["observations"])
        buffer.reset()
        for at in range(model.n_steps):
            rewards = normaliser.reward(whole["rewards"][at], whole["over"][at]) + whole["bootstraps"][at]
            buffer.add(
                shown[at],
                whole["actions"][at],
                rewards,
                whole["starts"][at],
                torch.as_tensor(whole["values"][at]),
                torch.as_tensor(whole["log_probs"][at]),
            )
        after = np.concatenate([part.after for part in parts])
        last_values = np.concatenate([part.last_values for part in parts])
        buffer.compute_returns_and_advantage(torch.as_tensor(last_values), whole["over"][-1])
        model._last_obs, model._last_episode_starts = normaliser.shown(after), whole["over"][-1]
        if normaliser.observations:
            rows = np.concatenate([whole["observations"][1:].reshape(-1, after.shape[-1]), after])
            normaliser.observed.update(rows)
        for part in parts:
            self.episodes.extend(part.episodes)
            self.done += len(part.episodes)
        model.num_timesteps += model.n_steps * self.num_envs
        return True


_BY_STEP = ("observations", "actions", "rewards", "bootstraps", "values", "log_probs", "starts", "over")


def shares(count: int, workers: int, seed: int, **common: Any) -> list[Share]:
    """Divide environments among workers as evenly as possible; environment k has the seed plus k."""
    sizes = [len(part) for part in np.array_split(np.arange(count), min(workers, count))]
    firsts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return [
        Share(count=size, seed=seed + int(first), **common) for size, first in zip(sizes, firsts, strict=True)
    ]
