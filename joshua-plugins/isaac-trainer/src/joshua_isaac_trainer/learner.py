"""Learning with rsl_rl in iterations, with a state that can be saved at any time, without pickle."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joshua_training.run_folder import RunError, read_part
from rsl_rl.runners import OnPolicyRunner
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from joshua_isaac_trainer.networks import policy_weights
from joshua_isaac_trainer.settings import IsaacSettings

ABOUT, WEIGHTS = "policy.json", "policy.safetensors"
TRAINING, STATE = "training.safetensors", "state.json"

#: Finished episodes that figures are averages of.
EPISODES = 200


class Learner:
    """Trains a policy by PPO.

    Args:
        settings: of the file; environment: a ``VecEnv`` of rsl_rl, whose step gives ``success`` in its
            extras, shape (N,), for environments whose episode ended.
        device: of the networks; asked: whether to stop.
    """

    def __init__(
        self,
        settings: IsaacSettings,
        environment: Any,
        device: str,
        seed: int = 0,
        asked: Callable[[], bool] = lambda: False,
    ) -> None:
        torch.manual_seed(seed)
        self._settings, self._environment, self._asked = settings, environment, asked
        self._device = device
        self._length = settings.n_steps or 1
        self._runner: Any = OnPolicyRunner(environment, settings.runner(), log_dir=None, device=device)
        self._algorithm: Any = self._runner.alg
        self._scaler = _Returns(environment.num_envs, settings.gamma, device)
        count = environment.num_envs
        self._sums = torch.zeros(count, device=device)
        self._lengths = torch.zeros(count, device=device)
        self._episodes: deque[tuple[float, float, float | None]] = deque(maxlen=EPISODES)
        self._done = 0
        self._iterations = 0
        self._observations: Any = None

    @property
    def steps(self) -> int:
        """Environment steps of the complete iterations."""
        return self._iterations * self._length * int(self._environment.num_envs)

    def iterate(self) -> dict[str, float] | None:
        """Collect and update once. Returns metrics; None if learning was stopped.

        Raises:
            RunError: a loss is not a number.
        """
        begun_s = time.perf_counter()
        algorithm = self._algorithm
        try:
            losses = self._collected_and_updated()
        except (RuntimeError, ValueError) as error:  # torch refuses a spread that is not a number
            if "std >= 0" not in str(error) and "constraint" not in str(error):
                raise
            raise self._diverged("an action") from error
        if losses is None:
            return None
        wrong = [name for name, value in losses.items() if not np.isfinite(value)]
        if wrong or not all(bool(torch.isfinite(weight).all()) for weight in algorithm.policy.parameters()):
            raise self._diverged(", ".join(wrong) or "a weight")
        self._iterations += 1
        elapsed_s = time.perf_counter() - begun_s
        row = {
            "steps": float(self.steps),
            "episodes": float(self._done),
            "rate/steps_per_s": self._length * self._environment.num_envs / max(elapsed_s, 1e-9),
            "train/learning_rate": float(algorithm.learning_rate),
            "train/std": float(algorithm.policy.action_std.detach().mean()),
            **{f"train/{name}_loss": float(value) for name, value in losses.items() if name != "entropy"},
        }
        if "entropy" in losses:
            row["train/entropy"] = float(losses["entropy"])
        if self._episodes:
            returns, lengths, successes = zip(*self._episodes, strict=True)
            row["episode/return"] = float(np.mean(returns))
            row["episode/length"] = float(np.mean(lengths))
            if None not in successes:  # which a task judges, or not
                row["episode/success_rate"] = float(np.mean(successes))
        return row

    def _collected_and_updated(self) -> Mapping[str, float] | None:
        """Collect and update once; return the losses, None if learning was stopped."""
        algorithm, settings = self._algorithm, self._settings
        if self._observations is None:
            self._observations = self._environment.get_observations().to(self._device)
        self._runner.train_mode()
        with torch.inference_mode():
            for _ in range(self._length):
                if self._asked():
                    algorithm.storage.clear()
                    return None
                actions = algorithm.act(self._observations)
                seen, rewards, dones, extras = self._environment.step(actions.to(self._environment.device))
                seen, rewards, dones = (
                    part.to(self._device) for part in (seen, rewards.reshape(-1), dones.reshape(-1))
                )
                self._count(rewards, dones, extras)
                if settings.normalize_rewards:
                    rewards = self._scaler.scaled(rewards, dones)
                algorithm.process_env_step(seen, rewards, dones, extras)
                self._observations = seen
            algorithm.compute_returns(self._observations)
        losses: Mapping[str, float] = algorithm.update()
        return losses

    def _diverged(self, what: str) -> RunError:
        return RunError(
            f"{what} is not a number after {self.steps} steps: lower learning_rate, or raise batch_size; the "
            "checkpoints are from before that"
        )

    def last_batch(self) -> dict[str, Any]:
        """Return the samples of the last update and the weights, which led to a loss that is not a number."""
        storage = self._algorithm.storage
        samples = {name: getattr(storage, name) for name in ("actions", "rewards", "values", "advantages")}
        samples["observations"] = storage.observations["policy"]
        arrays = _arrays({name: values.flatten(0, 1) for name, values in samples.items()})
        weights = _arrays(self._algorithm.policy.state_dict())
        return arrays | {f"weights.{name}": values for name, values in weights.items()}

    def files(self, about: Mapping[str, Any]) -> dict[str, bytes]:
        """Return the files of a checkpoint by name; ``about`` describes the policy."""
        policy = _arrays(self._algorithm.policy.state_dict())
        training = {f"policy.{name}": value for name, value in policy.items()}
        for index, memory in self._algorithm.optimizer.state_dict()["state"].items():
            for name, value in memory.items():
                training[f"optimiser.{index}.{name}"] = torch.as_tensor(value).cpu().numpy().copy()
        training |= self._scaler.arrays()
        state = {
            "format": 1,
            "algorithm": "PPO",
            "steps": self.steps,
            "iterations": self._iterations,
            "learning_rate": float(self._algorithm.learning_rate),
            "episodes": [list(episode) for episode in self._episodes],
            "episodes_done": self._done,
        }
        return {
            ABOUT: json.dumps(about, indent=2, sort_keys=True).encode() + b"\n",
            WEIGHTS: save_arrays(policy_weights(policy)),
            TRAINING: save_arrays({name: np.ascontiguousarray(v) for name, v in training.items()}),
            STATE: json.dumps(state, indent=2, sort_keys=True).encode() + b"\n",
        }

    def restore(self, checkpoint: Path) -> None:
        """Continue from a checkpoint: networks, optimiser, normalisation. Episodes start afresh.

        Raises:
            RunError: it is missing, truncated, not from this trainer, or of another network.
        """
        policy, optimiser = self._algorithm.policy, self._algorithm.optimizer
        arrays = read_part(checkpoint, TRAINING, load_arrays)
        state = read_part(checkpoint, STATE, json.loads, "iterations", "learning_rate")
        own = {name: torch.from_numpy(np.array(v)) for name, v in arrays.items()}
        try:
            policy.load_state_dict({k[7:]: v for k, v in own.items() if k.startswith("policy.")})
            memory: dict[int, dict[str, Any]] = {}
            for key, value in own.items():
                kind, _, rest = key.partition(".")
                if kind == "optimiser":
                    index, _, name = rest.partition(".")
                    memory.setdefault(int(index), {})[name] = value
            whole = optimiser.state_dict()
            whole["state"] = memory
            optimiser.load_state_dict(whole)
            self._scaler.load(arrays)
        except (RuntimeError, ValueError, KeyError) as error:
            reason = str(error).splitlines()[-1].strip()
            raise RunError(
                f"the checkpoint {checkpoint} does not fit the network of this file: {reason}"
            ) from error
        if self._settings.target_kl is not None:
            rate = self._algorithm.learning_rate = float(state["learning_rate"])
            for group in optimiser.param_groups:
                group["lr"] = rate
        self._iterations = int(state["iterations"])
        self._done = int(state.get("episodes_done", 0))
        self._episodes.extend((r, n, s) for r, n, s in state.get("episodes", []))

    def _count(self, rewards: torch.Tensor, dones: torch.Tensor, extras: Mapping[str, Any]) -> None:
        self._sums += rewards
        self._lengths += 1
        over = dones > 0
        if bool(over.any()):
            success = extras.get("success")
            count = int(over.sum())
            won = success.to(self._device)[over].float().tolist() if success is not None else [None] * count
            rows = zip(self._sums[over].tolist(), self._lengths[over].tolist(), won, strict=True)
            self._episodes.extend(rows)
            self._done += count
            self._sums[over] = 0.0
            self._lengths[over] = 0.0


class _Returns:
    """Divides rewards by the running spread of the discounted returns."""

    def __init__(self, count: int, gamma: float, device: str) -> None:
        self._gamma = gamma
        self._returns = torch.zeros(count, device=device)
        self._mean, self._variance, self._samples = 0.0, 1.0, 1e-4

    def scaled(self, rewards: torch.Tensor, dones: torch.Tensor) -> torch.Tensor:
        self._returns = self._returns * self._gamma + rewards
        mean, variance, count = (
            float(self._returns.mean()),
            float(self._returns.var(unbiased=False)),
            len(rewards),
        )
        total = self._samples + count
        way = mean - self._mean
        spread = self._variance * self._samples + variance * count + way**2 * self._samples * count / total
        self._mean, self._variance, self._samples = self._mean + way * count / total, spread / total, total
        self._returns[dones > 0] = 0.0
        return torch.clamp(rewards / (self._variance + 1e-8) ** 0.5, -10.0, 10.0)

    def arrays(self) -> dict[str, Any]:
        return {"returns.moments": np.array([self._mean, self._variance, self._samples])}

    def load(self, arrays: Mapping[str, Any]) -> None:
        self._mean, self._variance, self._samples = (float(value) for value in arrays["returns.moments"])


def _arrays(tensors: Mapping[str, torch.Tensor]) -> dict[str, Any]:
    return {name: value.detach().cpu().numpy().copy() for name, value in tensors.items()}
