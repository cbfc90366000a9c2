"""Node of the trainer: makes environments and learner in JAX, and writes the run's folder."""

from __future__ import annotations

import logging
import os
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from typing import Any

from joshua.tools import load_target
from joshua_ppo_trainer.node import RlTrainer
from joshua_training.run_folder import LibraryMissing, RunError

from joshua_mjx_trainer.settings import MjxSettings

#: Threads that XLA uses on a CPU at least; with fewer, it waits for ever at several hundred environments.
_THREADS = 8

#: Environments beyond which a CPU takes minutes for an update.
_MANY = 256


class MjxTrainer(RlTrainer):
    """Trains a policy by PPO on an accelerator, and ends the run when all steps are done."""

    SETTINGS = MjxSettings

    def make(self, chosen: Any, seed: int) -> tuple[Any, Any]:
        """Make the environments and the learner. Raises RunError."""
        os.environ.setdefault("NPROC", str(max(os.cpu_count() or 1, _THREADS)))
        for name in ("absl", "jax"):  # they name every platform that is not there
            logging.getLogger(name).setLevel(logging.WARNING)
        try:
            with redirect_stdout(StringIO()):  # MuJoCo XLA prints that it has no Warp
                for name in ("jax", "mujoco.mjx", "safetensors", "tensorboard"):
                    import_module(name)
            import gymnasium
            import jax
            from joshua_mujoco_sim.envs.single import make_task

            from joshua_mjx_trainer.environment import MjxEnvironments
            from joshua_mjx_trainer.learner import Learner
        except ImportError as error:
            raise LibraryMissing(
                f"training requires {error.name}, which is not installed: "
                "install joshua-mjx-trainer[learn] (from a clone: ./run --with 'mjx-trainer[learn]')"
            ) from error
        try:
            device = jax.devices()[0]
        except (RuntimeError, AssertionError) as error:  # by version
            raise RunError(
                f"JAX finds no device of the platform {os.environ.get('JAX_PLATFORMS', '')!r}, which "
                "JAX_PLATFORMS names: install jax[cuda12] for an NVIDIA GPU, or unset JAX_PLATFORMS"
            ) from error
        settings = self.settings
        self.context.log.info(
            "JAX computes on %s; the first update compiles, for a minute", device.device_kind
        )
        if device.platform == "cpu":
            self._warn_of_cpu(settings.num_envs)
        load_target(chosen.make)  # whose module registers the environment
        registered = gymnasium.registry.get(chosen.environment_id)
        task = registered.kwargs.get("task") if registered is not None else None
        if task is None:
            raise RunError(
                f"{chosen.environment_id} is not made of terms, which MuJoCo XLA requires: choose an "
                "environment of joshua-mujoco-sim, or train with simulator_backend: BACKEND_MUJOCO"
            )
        try:
            made = make_task(task, chosen.reward_function, None, settings.randomise)
        except ValueError as error:  # of the task
            raise RunError(
                f"{chosen.environment_id} cannot be made with randomise {settings.randomise}: {error}"
            ) from error
        environments = MjxEnvironments(made)
        learner = Learner(settings, environments, seed, lambda: self.context.stopping, self.tell_steps)
        return environments, learner

    def prepare(self) -> bool:
        """Start all episodes, which compiles."""
        self._learner.prepare()
        return not self.context.stopping

    def deactivate(self) -> None:
        """Wait for the last files, unless JAX still compiles, which nothing interrupts: then none are due."""
        if self._learner is None or self._learner.compiled:
            super().deactivate()
        else:
            self.context.log.info("stopped before the first update: nothing new was learned")

    def _warn_of_cpu(self, num_envs: int) -> None:
        """Say how slow a training without an accelerator is."""
        self.context.log.warning(
            "JAX found no accelerator, and on a CPU MuJoCo XLA is 50 to 150 times slower than MuJoCo: "
            "install jax[cuda12] for an NVIDIA GPU, or train with simulator_backend: BACKEND_MUJOCO"
        )
        if num_envs > _MANY:
            self.context.log.warning(
                "%d environments take minutes for each update on a CPU: set num_envs to 64 for a try",
                num_envs,
            )
