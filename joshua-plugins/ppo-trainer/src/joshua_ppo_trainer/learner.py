"""Learning with stable-baselines3 in iterations, with a state that can be saved at any time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch
from joshua_training.memory import require
from joshua_training.run_folder import RunError
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from joshua_ppo_trainer import checkpoint
from joshua_ppo_trainer.files import DivergedError as DivergedError
from joshua_ppo_trainer.normalise import Normaliser, Unapplied
from joshua_ppo_trainer.sac import PREFIX, NormalisedSac
from joshua_ppo_trainer.settings import TrainerSettings
from joshua_ppo_trainer.spread import SIZES, SpreadEnvironment, SpreadVecEnv
from joshua_ppo_trainer.vec_env import BatchedVecEnv

_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU}

#: Format of a checkpoint; before 2, the replay buffer of SAC held normalised values.
_FORMATS = {"PPO": 1, "SAC": 2}

#: Policy updates of SAC between two rows of metrics.
SAC_STEPS = 2_000


class Stopped(Exception):
    """The learner was stopped in the middle of an iteration."""


class _StoppableBuffer(RolloutBuffer):  # type: ignore[misc,unused-ignore]
    """Asks before each mini-batch whether learning continues, so that a stop does not wait for an update."""

    asked: Callable[[], bool] = staticmethod(lambda: False)
    last: Any = None

    def get(self, batch_size: int | None = None) -> Iterator[Any]:
        for batch in super().get(batch_size):
            if self.asked():
                raise Stopped
            self.last = batch
            yield batch


def network_of(settings: TrainerSettings) -> dict[str, Any]:
    """Return the keywords of a policy that describe its network."""
    return {
        "net_arch": list(settings.hidden_sizes),
        "activation_fn": _ACTIVATIONS[settings.activation],
    }


class _Watch(BaseCallback):  # type: ignore[misc,unused-ignore]
    """Ends the collection when learning stops, and reports its progress."""

    def __init__(self, asked: Callable[[], bool], told: Callable[[int], None]) -> None:
        super().__init__()
        self._asked, self._told = asked, told

    def _on_step(self) -> bool:
        self._told(self.num_timesteps)
        return not self._asked()


class Learner:
    """Trains a policy.

    Args:
        settings: complete, see ``TrainerSettings.suitable``.
        environment: many environments, in the mode SAME_STEP; seed: of the networks and the samples.
        asked: whether to stop; told: called with the number of steps, often.

    Attributes:
        steps: environment steps so far; rows of metrics come from ``iterate``.
    """

    def __init__(
        self,
        settings: TrainerSettings,
        environment: Any,
        seed: int,
        asked: Callable[[], bool] = lambda: False,
        told: Callable[[int], None] = lambda steps: None,
    ) -> None:
        self._settings, self._environment = settings, environment
        self.normaliser = Normaliser(
            environment.single_observation_space.shape[0],
            environment.num_envs,
            settings.gamma,
            observations=bool(settings.normalize_observations),
            rewards=bool(settings.normalize_rewards),
        )
        self._require_memory()
        self.vec_env: BatchedVecEnv
        if isinstance(environment, SpreadEnvironment):
            self.vec_env = SpreadVecEnv(environment, self.normaliser)
        elif settings.algorithm == "SAC":
            self.vec_env = BatchedVecEnv(environment, Unapplied(self.normaliser))
        else:
            self.vec_env = BatchedVecEnv(environment, self.normaliser)
        self._asked, self._told = asked, told
        self._watch = _Watch(asked, told)
        self._model: Any = self._ppo(seed) if settings.algorithm == "PPO" else self._sac(seed)
        self._model.set_logger(Logger(folder=None, output_formats=[]))
        self._snapshot: tuple[dict[str, Any], dict[str, Any], dict[str, Any]] | None = None
        self._callback: Any = None
        self._iterations = 0
        self._started = False

    @property
    def steps(self) -> int:
        """Environment steps so far."""
        return int(self._model.num_timesteps)

    @property
    def complete_steps(self) -> int:
        """Environment steps of the complete iterations, which a snapshot holds."""
        return int(self._snapshot[2]["steps"]) if self._snapshot is not None else 0

    @property
    def policy(self) -> Any:
        """Policy of stable-baselines3."""
        return self._model.policy

    def iterate(self) -> dict[str, float] | None:
        """Collect and update once. Returns the metrics; None if learning was stopped.

        Raises:
            DivergedError: a loss is not a number; the state is that from before the iteration.
        """
        model = self._model
        self._start()
        begun_s, before = time.perf_counter(), model.num_timesteps
        model.policy.set_training_mode(False)
        try:
            if not self._learn_once():
                return None
        except Stopped:
            return None
        except ValueError as error:  # torch's distributions refuse NaN, or where told not to the environments
            if not any(part in str(error) for part in ("constraint", "is not finite")):
                raise
            raise self._diverged("an action") from error
        self._iterations += 1
        values = {name: float(value) for name, value in model.logger.name_to_value.items()}
        model.logger.name_to_value.clear()
        losses = [name for name, value in values.items() if "loss" in name and not np.isfinite(value)]
        if losses or not all(bool(torch.isfinite(weight).all()) for weight in model.policy.parameters()):
            raise self._diverged(", ".join(losses) or "a weight")
        self._snapshot = self._take()
        rate = (model.num_timesteps - before) / max(time.perf_counter() - begun_s, 1e-9)
        return self.metrics() | {"rate/steps_per_s": rate} | values

    def _start(self) -> None:
        """Start the episodes before the first iteration, unless a snapshot was restored."""
        if not self._started:
            _, self._callback = self._model._setup_learn(
                self._settings.total_timesteps, self._watch, reset_num_timesteps=self._iterations == 0
            )
            self._started = True
            if self._snapshot is None:
                self._snapshot = self._take()

    def _diverged(self, what: str) -> DivergedError:
        return DivergedError(
            f"{what} is not a number after {self.steps} steps: lower learning_rate, or raise batch_size; "
            "the checkpoints are from before that"
        )

    def snapshot(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Return weights, further arrays of the training and the state, after the last complete iteration.

        The arrays of a replay buffer are not copied: they hold until the next iteration.
        """
        self._start()
        policy, training, state = kept = self._snapshot or self._take()
        if self._settings.algorithm != "SAC":
            return kept
        replay = self._model.replay_buffer
        replay.undo()  # of an iteration that was stopped in its middle
        return policy, training | replay.arrays(), state

    def last_batch(self) -> dict[str, Any]:
        """Return the samples of the last update and the weights, which led to a loss that is not a number."""
        model = self._model
        buffer = model.rollout_buffer if self._settings.algorithm == "PPO" else model.replay_buffer
        batch = buffer.last._asdict() if buffer.last is not None else {}
        found = {
            name: value.detach().cpu().numpy() for name, value in batch.items() if hasattr(value, "detach")
        }
        return found | checkpoint.weights_of(model.policy, "weights.")

    def restore(self, policy: dict[str, Any], training: dict[str, Any], state: dict[str, Any]) -> None:
        """Continue from a snapshot, bit for bit. To be called before the first iteration.

        Raises:
            RunError: it belongs to another network or other environments, or to an older version.
        """
        model = self._model
        if (found := state.get("format")) != _FORMATS[self._settings.algorithm]:
            raise RunError(
                f"the checkpoint has format {found}, but this version continues {self._settings.algorithm} "
                f"from format {_FORMATS[self._settings.algorithm]} only: start a new run"
            )
        checkpoint.load_weights(model.policy, policy)
        for name, optimiser in self._optimisers().items():
            checkpoint.load_optimiser(optimiser, training, name)
        self.normaliser.load(training)
        prefix = "environment."
        try:
            own = {name[len(prefix) :]: v for name, v in training.items() if name.startswith(prefix)}
            if (not own or SIZES in own) and not isinstance(self._environment, SpreadEnvironment):
                raise RunError(
                    "the environments of the checkpoint were in the workers of a cluster: continue with a "
                    "cluster"
                )
            self._environment.restore(own)
        except ValueError as error:
            raise RunError(f"{error}: continue with the num_envs and the environment of the run") from error
        vec_env = self.vec_env
        vec_env.returns[:], vec_env.lengths[:] = training["episode.returns"], training["episode.lengths"]
        vec_env.episodes.extend((r, n, s) for r, n, s in state["episodes"])
        vec_env.done = state["episodes_done"]
        model.num_timesteps, self._iterations = state["steps"], state["iterations"]
        model._n_updates = state["updates"]
        if self._settings.algorithm == "SAC":
            self._restore_sac(training, state)
        # with a last observation, the learner does not start the environments again
        model._last_obs, model._last_episode_starts = training["last.observation"], training["last.starts"]
        checkpoint.load_generators(training)
        kept = {name: v for name, v in training.items() if not name.startswith(PREFIX)}
        self._snapshot = (policy, kept, state)

    def _learn_once(self) -> bool:
        """Run one iteration of the algorithm; return False if learning was stopped."""
        model, settings = self._model, self._settings
        model._callback = self._callback
        if settings.algorithm == "PPO":
            if not self._collect():
                return False
            model._update_current_progress_remaining(model.num_timesteps, settings.total_timesteps)
            model.train()
            return True
        end = min(model.num_timesteps + SAC_STEPS, settings.total_timesteps)
        while model.num_timesteps < end:
            rollout = model.collect_rollouts(
                model.env,
                train_freq=model.train_freq,
                action_noise=model.action_noise,
                callback=self._callback,
                learning_starts=model.learning_starts,
                replay_buffer=model.replay_buffer,
                log_interval=None,
            )
            if not rollout.continue_training:
                return False
            if model.num_timesteps > model.learning_starts:
                model.train(batch_size=model.batch_size, gradient_steps=model.gradient_steps)
        return True

    def _collect(self) -> bool:
        """Collect a rollout of PPO, here or in the workers; return False if learning was stopped."""
        model = self._model
        if isinstance(self.vec_env, SpreadVecEnv):
            done = self.vec_env.rollout(model, self._iterations, self._asked)
            self._told(self.steps)
            return done
        return bool(
            model.collect_rollouts(
                model.env, self._callback, model.rollout_buffer, n_rollout_steps=model.n_steps
            )
        )

    def _take(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        model, vec_env = self._model, self.vec_env
        policy = checkpoint.weights_of(model.policy)
        training: dict[str, Any] = self.normaliser.arrays() | checkpoint.generator_arrays()
        for name, optimiser in self._optimisers().items():
            training |= checkpoint.optimiser_arrays(optimiser, name)
        training |= {f"environment.{name}": v for name, v in self._environment.snapshot().items()}
        training |= {
            "episode.returns": vec_env.returns.copy(),
            "episode.lengths": vec_env.lengths.copy(),
            "last.observation": np.array(model._last_obs),
            "last.starts": np.array(model._last_episode_starts),
        }
        state = {
            "format": _FORMATS[self._settings.algorithm],
            "algorithm": self._settings.algorithm,
            "steps": self.steps,
            "iterations": self._iterations,
            "updates": int(model._n_updates),
            "episodes": [list(episode) for episode in vec_env.episodes],
            "episodes_done": vec_env.done,
        }
        if self._settings.algorithm == "SAC":
            model.replay_buffer.mark()
            training["entropy.log"] = model.log_ent_coef.detach().numpy().copy()
            state["replay"] = model.replay_buffer.state()
            state["action_space"] = checkpoint.space_state(model.action_space)
        return policy, training, state

    def _optimisers(self) -> dict[str, torch.optim.Optimizer]:
        """Return the optimisers by the prefix of their arrays in a checkpoint."""
        model = self._model
        if self._settings.algorithm == "PPO":
            return {"optimiser": model.policy.optimizer}
        return {
            "optimiser_actor": model.actor.optimizer,
            "optimiser_critic": model.critic.optimizer,
            "optimiser_entropy": model.ent_coef_optimizer,
        }

    def _restore_sac(self, training: dict[str, Any], state: dict[str, Any]) -> None:
        model = self._model
        model.replay_buffer.load(training, state["replay"])
        with torch.no_grad():
            model.log_ent_coef.copy_(torch.from_numpy(np.array(training["entropy.log"])))
        checkpoint.load_space(model.action_space, state["action_space"])

    def metrics(self) -> dict[str, float]:
        """Return averages over the last episodes, as of the last complete iteration."""
        episodes = self.vec_env.episodes
        found: dict[str, float] = {"steps": self.steps, "episodes": self.vec_env.done}
        if episodes:
            returns, lengths, successes = zip(*episodes, strict=True)
            found["episode/return"] = float(np.mean(returns))
            found["episode/length"] = float(np.mean(lengths))
            if getattr(self._environment, "judges_success", True):
                found["episode/success_rate"] = float(np.mean(successes))
        return found

    def _require_memory(self) -> None:
        """Refuse buffers that do not fit into the memory. Raises RunError."""
        settings, environment = self._settings, self._environment
        seen, wanted = environment.single_observation_space.shape[0], environment.single_action_space.shape[0]
        if settings.algorithm == "SAC":  # both observations, action, reward and two marks, of 32 bits each
            # a checkpoint is put together from it, and copied once more as bytes
            numbers = 3 * settings.buffer_size * (2 * seen + wanted + 3)
            purpose = "the replay buffer with its checkpoint"
        else:  # observation, action, reward, mark, value, probability, advantage, return
            numbers = settings.num_envs * (settings.n_steps or 1) * (seen + wanted + 6)
            purpose = "a rollout"
        require(4 * numbers, purpose, settings.halves())

    def _ppo(self, seed: int) -> Any:
        settings = self._settings
        buffer = type("Buffer", (_StoppableBuffer,), {"asked": staticmethod(self._asked)})
        return PPO(
            "MlpPolicy",
            self.vec_env,
            learning_rate=settings.learning_rate,
            n_steps=settings.n_steps or 1,
            batch_size=settings.batch_size,
            n_epochs=settings.n_epochs or 1,
            gamma=settings.gamma,
            gae_lambda=settings.gae_lambda if settings.gae_lambda is not None else 0.95,
            clip_range=settings.clip_range,
            ent_coef=settings.entropy_weight or 0.0,
            vf_coef=settings.value_weight,
            max_grad_norm=settings.max_grad_norm,
            target_kl=settings.target_kl,
            rollout_buffer_class=buffer,
            policy_kwargs={**network_of(settings), "log_std_init": settings.initial_log_std},
            seed=seed,
            device="cpu",
        )

    def _sac(self, seed: int) -> Any:
        settings = self._settings
        return NormalisedSac(
            "MlpPolicy",
            self.vec_env,
            normaliser=self.normaliser,
            learning_rate=settings.learning_rate,
            buffer_size=settings.buffer_size,
            learning_starts=settings.learning_starts,
            batch_size=settings.batch_size,
            tau=settings.tau,
            gamma=settings.gamma,
            train_freq=(1, "step"),
            gradient_steps=settings.updates_per_step,
            policy_kwargs=network_of(settings),
            seed=seed,
            device="cpu",
        )
