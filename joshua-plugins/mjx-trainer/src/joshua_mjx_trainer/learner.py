"""PPO in JAX: pure steps over one tree of arrays, which a checkpoint holds."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from joshua_ppo_trainer.files import DivergedError
from joshua_ppo_trainer.normalise import LIMIT
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_training.run_folder import RunError

from joshua_mjx_trainer import network

Tree = dict[str, Any]

#: Least number of last episodes over which success, return and length are averaged.
WINDOW = 200

#: Most steps of all environments between two questions whether to stop.
_CHUNK = 8


class Learner:
    """Trains a policy.

    Args:
        settings: complete, see ``TrainerSettings.suitable``.
        environments: as ``MjxEnvironments``; seed: of the networks, the samples and the episodes.
        asked: whether to stop; told: called with the number of steps, often.

    Attributes:
        tree: everything that learning changes, as arrays, after ``prepare`` or ``restore``.
        steps, iterations: complete so far.
        compiled: whether an iteration is complete here, all of whose functions JAX has compiled.
    """

    def __init__(
        self,
        settings: TrainerSettings,
        environments: Any,
        seed: int,
        asked: Callable[[], bool] = lambda: False,
        told: Callable[[int], None] = lambda steps: None,
    ) -> None:
        self._settings, self._environments = settings, environments
        self._asked, self._told = asked, told
        steps = self._n_steps = settings.n_steps or 1
        self._chunk = max(size for size in range(1, min(steps, _CHUNK) + 1) if steps % size == 0)
        self._collect = jax.jit(self._collected, static_argnums=1)
        self._learn = jax.jit(self._learned)
        self._advantages = jax.jit(self._judged)
        self._finite = jax.jit(_all_finite)
        self._window: deque[tuple[float, int, bool]] = deque(maxlen=max(WINDOW, settings.num_envs))
        self._batch: Tree = {}
        self._following: Tree = {}
        self.steps = self.iterations = self.episodes = 0
        self.compiled = False
        self.tree: Tree = {}
        self._key = jax.random.PRNGKey(seed)

    def prepare(self) -> None:
        """Start all episodes and make the networks, which takes seconds, unless that is done or restored."""
        if not self.tree:
            self.tree = jax.block_until_ready(jax.jit(self._first)(self._key))

    def iterate(self) -> dict[str, float] | None:
        """Collect and update once. Returns the metrics; None if learning was stopped.

        Raises:
            DivergedError: a loss is not a number; the state is that from before the iteration.
        """
        self.prepare()
        settings, begun_s = self._settings, time.perf_counter()
        tree, parts = self.tree, list[Tree]()
        while len(parts) * self._chunk < self._n_steps:
            if self._asked():
                return None
            tree, part = self._collect(tree, self._chunk)
            parts.append(jax.block_until_ready(part))
            self._told(self.steps + len(parts) * self._chunk * settings.num_envs)
        metrics: dict[str, float] = {}
        samples = {name: jnp.concatenate([part[name] for part in parts]) for name in parts[0]}
        batch = self._batch = self._advantages(tree, samples)
        for _ in range(settings.n_epochs or 1):
            if self._asked():
                return None
            tree, values = self._learn(tree, batch)
            metrics = {f"train/{name}": float(number) for name, number in values.items()}
            if metrics.pop("train/stopped"):
                break
        self._following = tree
        lost = [name for name, number in metrics.items() if not np.isfinite(number)]
        if lost or not self._finite((tree["weights"], tree["normalise"])):
            raise DivergedError(
                f"{', '.join(lost) or 'a weight'} is not a number after {self.steps} steps: lower "
                "learning_rate, or raise batch_size; the checkpoints are from before that"
            )
        self.tree, taken = tree, self._n_steps * settings.num_envs
        self.steps += taken
        self.iterations += 1
        self.compiled = True
        self._count({name: np.asarray(samples[name]) for name in ("over", "returns", "lengths", "success")})
        metrics["train/std"] = float(jnp.exp(tree["weights"]["log_std"]).mean())
        rate = taken / max(time.perf_counter() - begun_s, 1e-9)
        return self.metrics() | {"rate/steps_per_s": rate} | metrics

    @property
    def complete_steps(self) -> int:
        """Environment steps of the complete iterations, which a snapshot holds."""
        return self.steps

    def metrics(self) -> dict[str, float]:
        """Return averages over the last episodes, as of the last complete iteration."""
        found: dict[str, float] = {"steps": self.steps, "episodes": self.episodes}
        if self._window:
            returns, lengths, successes = zip(*self._window, strict=True)
            found["episode/return"] = float(np.mean(returns))
            found["episode/length"] = float(np.mean(lengths))
            if self._environments.task.judges_success:
                found["episode/success_rate"] = float(np.mean(successes))
        return found

    def last_batch(self) -> dict[str, Any]:
        """Return the samples of the last update and the weights, which led to a loss that is not a number."""
        weights = {f"weights.{name}": np.asarray(v) for name, v in self._following["weights"].items()}
        return {name: np.asarray(values) for name, values in self._batch.items()} | weights

    def snapshot(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Return weights, further arrays of the training and the state, after the last complete iteration."""
        named = {name: np.asarray(values) for name, values in _named(self.tree)}
        prefix = "weights."
        policy = {name[len(prefix) :]: values for name, values in named.items() if name.startswith(prefix)}
        training = {name: values for name, values in named.items() if not name.startswith(prefix)}
        state = {
            "format": 1,
            "algorithm": "PPO",
            "steps": self.steps,
            "iterations": self.iterations,
            "episodes": [list(episode) for episode in self._window],
            "episodes_done": self.episodes,
        }
        return policy, training, state

    def restore(
        self, policy: Mapping[str, Any], training: Mapping[str, Any], state: Mapping[str, Any]
    ) -> None:
        """Continue from a snapshot. To be called before the first iteration.

        Raises:
            RunError: it belongs to another network or other environments.
        """
        kept = {f"weights.{name}": values for name, values in policy.items()} | dict(training)
        found, shapes = [], jax.eval_shape(self._first, self._key)
        for name, values in _named(shapes):
            if name not in kept or kept[name].shape != (values.shape or (1,)):  # as files hold a number
                has = f"the shape {kept[name].shape}" if name in kept else "nothing"
                raise RunError(
                    f"the checkpoint does not fit the file: it has {has} for {name}, not {values.shape}: "
                    "continue with the num_envs, the environment and the hidden_sizes of the run"
                )
            found.append(jnp.asarray(kept[name], values.dtype).reshape(values.shape))
        self.tree = jax.tree.unflatten(jax.tree.structure(shapes), found)
        self.steps, self.iterations = state["steps"], state["iterations"]
        self.episodes = state["episodes_done"]
        self._window.extend((r, n, s) for r, n, s in state["episodes"])

    def _first(self, key: Any) -> Tree:
        """Return the tree before the first step."""
        settings, environments = self._settings, self._environments
        key, own = jax.random.split(key)
        keys = jax.vmap(lambda index: jax.random.fold_in(key, index))(jnp.arange(settings.num_envs))
        carry, observations = environments.reset(keys)
        width, actions = environments.single_observation_space.shape[0], environments.task.action_size
        weights = network.first_weights(own, width, actions, settings)
        moments = _moments((width,))
        if settings.normalize_observations:
            moments = _updated(moments, observations)
        return {
            "weights": weights,
            "optimiser": network.first_memory(weights),
            "normalise": {"observed": moments, "returned": _moments(())},
            "discounted": jnp.zeros(settings.num_envs),
            "returns": jnp.zeros(settings.num_envs),
            "lengths": jnp.zeros(settings.num_envs, jnp.int32),
            "environment": carry,
            "observations": self._shown(observations, moments),
            "key": jax.random.fold_in(key, settings.num_envs),
        }

    def _shown(self, observations: Any, moments: Tree) -> Any:
        """Normalise observations."""
        return _scaled(observations, moments) if self._settings.normalize_observations else observations

    def _collected(self, tree: Tree, length: int) -> tuple[Tree, Tree]:
        """Step all environments, and return the samples, each (length, N, …)."""
        following, samples = jax.lax.scan(lambda tree, _: self._one_step(tree), tree, None, length=length)
        return following, samples

    def _one_step(self, tree: Tree) -> tuple[Tree, Tree]:
        settings, weights, seen = self._settings, tree["weights"], tree["observations"]
        key, own = jax.random.split(tree["key"])
        mean = network.mean_action(weights, seen, settings)
        actions = mean + jnp.exp(weights["log_std"]) * jax.random.normal(own, mean.shape)
        carry, step = self._environments.step(tree["environment"], actions)
        over = step.terminated | step.truncated
        returns, lengths = tree["returns"] + step.rewards, tree["lengths"] + 1
        normalise, rewards, discounted = tree["normalise"], step.rewards, tree["discounted"]
        observed, returned = normalise["observed"], normalise["returned"]
        if settings.normalize_observations:
            observed = _updated(observed, step.observations)
        if settings.normalize_rewards:
            discounted = discounted * settings.gamma + rewards
            returned = _updated(returned, discounted)
            rewards = jnp.clip(rewards / jnp.sqrt(returned["variance"] + 1e-8), -LIMIT, LIMIT)
        # an episode that was cut off would have continued to be worth something
        further = network.value(weights, self._shown(step.final, observed), settings)
        samples = {
            "observations": seen,
            "actions": actions,
            "log_probabilities": network.log_probability(actions, mean, weights["log_std"]),
            "values": network.value(weights, seen, settings),
            "rewards": rewards + settings.gamma * jnp.where(step.truncated, further, 0.0),
            "over": over,
            "success": step.success,
            "returns": returns,
            "lengths": lengths,
        }
        following = {
            **tree,
            "normalise": {"observed": observed, "returned": returned},
            "discounted": jnp.where(over, 0.0, discounted),
            "returns": jnp.where(over, 0.0, returns),
            "lengths": jnp.where(over, 0, lengths),
            "environment": carry,
            "observations": self._shown(step.observations, observed),
            "key": key,
        }
        return following, samples

    def _judged(self, tree: Tree, samples: Tree) -> Tree:
        """Return the samples of an update by generalised advantage estimation, each (T · N, …)."""
        settings = self._settings
        last = network.value(tree["weights"], tree["observations"], settings)
        share = settings.gamma * (settings.gae_lambda if settings.gae_lambda is not None else 0.95)

        def back(carry: Any, step: Any) -> Any:
            advantage, following = carry
            reward, own, over = step
            goes_on = 1.0 - over
            delta = reward + settings.gamma * following * goes_on - own
            advantage = delta + share * goes_on * advantage
            return (advantage, own), advantage

        steps = (samples["rewards"], samples["values"], samples["over"].astype(jnp.float32))
        _, advantages = jax.lax.scan(back, (jnp.zeros_like(last), last), steps, reverse=True)
        batch = {name: samples[name] for name in ("observations", "actions", "log_probabilities")}
        batch |= {"advantages": advantages, "targets": advantages + samples["values"]}
        return {name: values.reshape(-1, *values.shape[2:]) for name, values in batch.items()}

    def _learned(self, tree: Tree, batch: Tree) -> tuple[Tree, Tree]:
        """Pass once over the samples in shuffled mini-batches; return the means of the losses."""
        settings = self._settings
        count = batch["advantages"].shape[0] // settings.batch_size
        key, own = jax.random.split(tree["key"])
        order = jax.random.permutation(own, batch["advantages"].shape[0])[: count * settings.batch_size]
        gradient_of = jax.value_and_grad(self._loss, has_aux=True)

        def update(carry: Any, rows: Any) -> Any:
            weights, memory, stopped = carry
            (_, values), gradient = gradient_of(weights, {name: v[rows] for name, v in batch.items()})
            changed, following = network.adam(weights, gradient, memory, settings)
            if settings.target_kl is not None:
                stopped = stopped | (values["approx_kl"] > 1.5 * settings.target_kl)
                changed = jax.tree.map(lambda new, old: jnp.where(stopped, old, new), changed, weights)
                following = jax.tree.map(lambda new, old: jnp.where(stopped, old, new), following, memory)
            return (changed, following, stopped), values

        carry = (tree["weights"], tree["optimiser"], jnp.array(False))
        (weights, memory, stopped), values = jax.lax.scan(
            update, carry, order.reshape(count, settings.batch_size)
        )
        means = {name: numbers.mean() for name, numbers in values.items()} | {"stopped": stopped}
        return {**tree, "weights": weights, "optimiser": memory, "key": key}, means

    def _loss(self, weights: Tree, batch: Tree) -> tuple[Any, Tree]:
        settings, log_std = self._settings, weights["log_std"]
        mean = network.mean_action(weights, batch["observations"], settings)
        values = network.value(weights, batch["observations"], settings)
        change = network.log_probability(batch["actions"], mean, log_std) - batch["log_probabilities"]
        ratio, advantages = jnp.exp(change), batch["advantages"]
        advantages = (advantages - advantages.mean()) / (advantages.std(ddof=1) + 1e-8)
        clipped = jnp.clip(ratio, 1 - settings.clip_range, 1 + settings.clip_range)
        policy_loss = -jnp.minimum(advantages * ratio, advantages * clipped).mean()
        value_loss = ((values - batch["targets"]) ** 2).mean()
        entropy_loss = -network.entropy(log_std)
        loss = (
            policy_loss + settings.value_weight * value_loss + (settings.entropy_weight or 0.0) * entropy_loss
        )
        return loss, {
            "loss": loss,
            "policy_gradient_loss": policy_loss,
            "value_loss": value_loss,
            "entropy_loss": entropy_loss,
            "approx_kl": (ratio - 1 - change).mean(),
            "clip_fraction": (jnp.abs(ratio - 1) > settings.clip_range).mean(),
        }

    def _count(self, samples: Mapping[str, Any]) -> None:
        """Take the ended episodes of an iteration into the averages, those that ended first first."""
        for step, index in np.argwhere(samples["over"]):
            self._window.append(
                (
                    float(samples["returns"][step, index]),
                    int(samples["lengths"][step, index]),
                    bool(samples["success"][step, index]),
                )
            )
        self.episodes += int(samples["over"].sum())


def _named(tree: Tree) -> list[tuple[str, Any]]:
    """Return the arrays of a tree by their path."""
    return [
        (".".join(str(part.key) for part in path), values)
        for path, values in jax.tree_util.tree_flatten_with_path(tree)[0]
    ]


def _all_finite(tree: Any) -> Any:
    """Return whether all numbers of a tree are finite."""
    return jnp.stack([jnp.isfinite(values).all() for values in jax.tree.leaves(tree)]).all()


def _moments(shape: tuple[int, ...]) -> Tree:
    """Return running moments before the first row, see ``joshua_ppo_trainer.normalise.Moments``."""
    return {"mean": jnp.zeros(shape), "variance": jnp.ones(shape), "count": jnp.float32(1e-4)}


def _updated(moments: Tree, rows: Any) -> Tree:
    """Return moments with rows added, shape (N, …)."""
    mean, variance, count = rows.mean(axis=0), rows.var(axis=0), rows.shape[0]
    total = moments["count"] + count
    way = mean - moments["mean"]
    spread = moments["variance"] * moments["count"] + variance * count
    spread = spread + way**2 * (moments["count"] * count / total)
    return {"mean": moments["mean"] + way * (count / total), "variance": spread / total, "count": total}


def _scaled(values: Any, moments: Tree) -> Any:
    scaled = (values - moments["mean"]) / jnp.sqrt(moments["variance"] + 1e-8)
    return jnp.clip(scaled, -LIMIT, LIMIT)
