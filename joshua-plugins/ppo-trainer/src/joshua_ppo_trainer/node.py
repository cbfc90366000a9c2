"""Nodes of trainers by reinforcement: environments and learner, in the folder of a run."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from joshua.api import FieldError, NodeContext
from joshua.tools import load_target
from joshua_jobs.choice import opened
from joshua_training.clusters import on_cluster
from joshua_training.run_folder import LibraryMissing, RunError, unusable
from joshua_training.trainer import LearningNode

from joshua_ppo_trainer import files
from joshua_ppo_trainer.settings import TrainerSettings

#: The samples and weights of an update whose loss was not a number.
BATCH = "diverged.safetensors"

#: Settings that ``run.json`` does not repeat.
_HIDDEN = {"environment", "environment_id", "output_folder", "resume_run", "tracking"}


class RlTrainer(LearningNode):
    """Trains a policy in simulated environments, and ends the run when all steps are done."""

    SHOWN: ClassVar[tuple[tuple[str, str], ...]] = (
        ("episode/success_rate", "success {:.2f}"),
        ("episode/return", "return {:.1f}"),
    )
    FREE = ("total_timesteps", "checkpoint_steps", "physics_threads", "learning_rate")

    #: Settings of the trainer.
    SETTINGS: ClassVar[type[TrainerSettings]] = TrainerSettings

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self.settings = self.SETTINGS.model_validate(context.spec.settings)
        self._environment: Any = None
        self._learner: Any = None

    @abstractmethod
    def make(self, chosen: Any, seed: int) -> tuple[Any, Any]:
        """Make environments and learner, with the complete ``settings``.

        Args:
            chosen: environment of the plan; seed: of everything random.

        Raises:
            RunError: a library is missing, or the environment does not fit.
        """

    def configure(self) -> None:
        """Make or open the run and its environments."""
        chosen = self.facts.environment
        if chosen is None:
            raise RunError("the plan has no environment: set ai.training.environment_id")
        settings = self.settings = self.settings.suitable(chosen.environment_id)
        try:
            settings.check_batch()
        except FieldError as error:  # known only here if the file names no environment
            raise RunError(f"{error}: {error.remedy}") from error
        seed = 0 if chosen.seed is None else chosen.seed
        facts: dict[str, Any] = {
            "simulator_backend": settings.BACKEND,
            "environment": chosen.environment_id,
            "reward_function": chosen.reward_function,
            "seed": seed,
            "settings": settings.model_dump(exclude=_HIDDEN.union(settings.foreign)),
        }
        self.checkpoint_steps = settings.checkpoint_steps
        self.halves = settings.halves()
        continued = self.reopen(settings.resume_run, facts)
        self._environment, self._learner = self.make(chosen, seed)
        if continued is None:
            name = chosen.environment_id.partition("/")[2] or chosen.environment_id
            self.begin(settings.output_folder, re.sub(r"[^A-Za-z0-9]+", "-", name), facts)
        else:
            content = files.read(continued)
            try:
                self._learner.restore(*content)
            except (KeyError, TypeError, ValueError, IndexError) as error:
                reason = f"it is not from this trainer ({type(error).__name__}: {error})"
                raise unusable(continued, reason) from error
            self.continue_after(continued)

    @property
    def steps(self) -> int:
        """Environment steps of the complete iterations."""
        return int(self._learner.complete_steps)

    @property
    def total(self) -> int:
        """Environment steps of the whole training."""
        return self.settings.total_timesteps

    def advance(self) -> Mapping[str, float] | None:
        """Collect and update once."""
        try:
            row: Mapping[str, float] | None = self._learner.iterate()
        except files.DivergedError as error:
            raise RunError(f"{error}; {self._kept_batch()}") from error
        return row

    def save(self) -> Path:
        """Write a checkpoint: policy, training, state."""
        policy, training, state = self._learner.snapshot()
        content = files.as_files(policy, training, state, self._about_policy(training))
        return self.folder.save(state["steps"], content)

    def _kept_batch(self) -> str:
        """Write the samples of the last update and the weights after it; return where."""
        try:
            path = self.folder.write(BATCH, files.packed(self._learner.last_batch()))
        except RunError as error:  # which must not hide why learning ended
            return str(error)
        return f"the batch and the weights are in {path}"

    def _about_policy(self, training: dict[str, Any]) -> dict[str, Any]:
        """Describe the inputs and outputs of a policy, and the scaling of its inputs."""
        settings, moments = self.settings, "normalise.observed"
        seen = {key: training[f"{moments}.{key}"].tolist() for key in ("mean", "variance")}
        return {
            **_policy_facts(self.facts.environment, self._environment),
            "format": 1,
            "algorithm": settings.algorithm,
            "activation": settings.activation,
            "normalisation": seen if settings.normalize_observations else None,
        }

    def tell_steps(self, steps: int) -> None:
        """Report the progress."""
        total = self.settings.total_timesteps
        self.context.progress("training", float(min(steps, total)), float(total), unit="steps")


class PpoTrainer(RlTrainer):
    """Trains a policy by PPO or SAC on the CPU. The workers of a cluster can collect the rollouts of PPO."""

    SHOWN = (*RlTrainer.SHOWN, ("workers_lost", "{:.0f} workers lost"))

    def make(self, chosen: Any, seed: int) -> tuple[Any, Any]:
        """Make the environments and the learner. Raises RunError."""
        try:
            for name in ("torch", "safetensors", "tensorboard"):
                import_module(name)
            import torch

            from joshua_ppo_trainer.learner import Learner
        except ImportError as error:
            raise LibraryMissing(
                f"training requires {error.name}, which is not installed: "
                "install joshua-ppo-trainer[learn] "
                "(from a clone: ./run --with 'ppo-trainer[learn],mujoco-sim')"
            ) from error
        torch.set_num_threads(1)  # with small networks, more threads only wait for each other
        settings = self.settings
        options: dict[str, Any] = {"threads": settings.physics_threads, "autoreset_mode": "SameStep"}
        if settings.randomise:
            options["randomise"] = True
        try:
            environment = load_target(chosen.make)(
                chosen.environment_id,
                reward_function=chosen.reward_function,
                num_envs=1 if settings.cluster else chosen.num_envs,
                seed=seed,
                **options,
            )
        except (ValueError, TypeError) as error:  # of the environment's plugin
            asked = ", ".join(f"{name} {value}" for name, value in options.items())
            raise RunError(
                f"{chosen.environment_id} cannot be made with {asked}: {error}: change what the message names"
            ) from error
        if not hasattr(environment, "advance"):
            raise RunError(
                f"{chosen.environment_id} runs one environment after the other here; this trainer requires "
                "environments that step together: install MuJoCo 4 (Python 3.11)"
            )
        environment.reset(seed=seed)
        if settings.cluster:
            environment = self._spread(environment, chosen, seed)
        self._environment = environment
        learner = Learner(settings, environment, seed, lambda: self.context.stopping, self.tell_steps)
        return environment, learner

    def _spread(self, local: Any, chosen: Any, seed: int) -> Any:
        """Make the environments in the workers of the cluster. Raises RunError."""
        from joshua_ppo_trainer.learner import network_of
        from joshua_ppo_trainer.spread import SpreadEnvironment, shares

        settings = self.settings
        with on_cluster():
            executor = opened(("ray", settings.cluster), settings.cluster_workers)
        parts = shares(
            chosen.num_envs,
            max(1, executor.workers),
            seed,
            make=chosen.make,
            environment_id=chosen.environment_id,
            reward_function=chosen.reward_function,
            randomise=settings.randomise,
            network={**network_of(settings), "log_std_init": settings.initial_log_std},
            gamma=settings.gamma,
            observations=bool(settings.normalize_observations),
        )
        self.context.log.info("%d workers of the cluster %s collect", len(parts), settings.cluster)
        return SpreadEnvironment(local, executor, parts, self.warn)

    def advance(self) -> Mapping[str, float] | None:
        """Collect and update once; workers that were lost are counted."""
        row = super().advance()
        if row is not None and self.settings.cluster:
            return {**row, "workers_lost": float(self._environment.lost)}
        return row

    def release(self) -> None:
        """Close the environments."""
        if self._environment is not None:
            self._environment.close()


def _policy_facts(chosen: Any, environment: Any) -> dict[str, Any]:
    """Describe the inputs and outputs of a policy in physical units, and the constants of their scaling."""
    offset, scale = environment.observation_scaling
    space = environment.single_action_space
    return {
        "environment": chosen.environment_id,
        "features": {
            key: {"shape": list(feature.shape), "names": list(feature.names), "unit": feature.unit}
            for key, feature in environment.features.items()
        },
        "rate_hz": float(environment.metadata.get("render_fps") or 0.0),
        "observation_offset": offset.tolist(),
        "observation_scale": scale.tolist(),
        "action_low": space.low.tolist(),
        "action_high": space.high.tolist(),
    }
