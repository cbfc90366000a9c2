"""Node of the trainer: makes the environments, learns on its own thread, writes the run's folder."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

from joshua.api import FieldError, NodeContext, Trainer
from joshua.tools import load_target
from joshua_training.run_folder import LibraryMissing, RunError, RunFolder, described

from joshua_ppo_trainer.settings import TrainerSettings

#: How long a stop waits for the last checkpoint.
SAVE_S = 8.0

#: The samples and weights of an update whose loss was not a number.
BATCH = "diverged.safetensors"

#: Longest time without a heartbeat, during an update of a large batch.
HANG_S = 600.0


class PpoTrainer(Trainer):
    """Trains a policy by PPO or SAC, and ends the run when all steps are done."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = TrainerSettings.model_validate(context.spec.settings)
        self._ended = threading.Event()
        self._ended.set()
        self._environment: Any = None
        self._learner: Any = None
        self._folder: RunFolder | None = None
        self._saved = -1

    def configure(self) -> None:
        """Make or open the run and its environments."""
        chosen = self.facts.environment
        if chosen is None:
            raise RunError("the plan has no environment: set ai.training.environment_id")
        try:
            import torch

            from joshua_ppo_trainer import checkpoint
            from joshua_ppo_trainer.learner import Learner
        except ImportError as error:
            raise LibraryMissing(
                f"training requires {error.name}, which is not installed: "
                "install joshua-ppo-trainer[learn] "
                "(from a clone: ./run --with 'ppo-trainer[learn],mujoco-sim')"
            ) from error
        torch.set_num_threads(1)  # with small networks, more threads only wait for each other
        settings = self._settings = self._settings.suitable(chosen.environment_id)
        try:
            settings.check_batch()
        except FieldError as error:  # known only here if the file names no environment
            raise RunError(f"{error}: {error.remedy}") from error
        seed = 0 if chosen.seed is None else chosen.seed
        facts: dict[str, Any] = {
            "environment": chosen.environment_id,
            "reward_function": chosen.reward_function,
            "seed": seed,
            "settings": settings.model_dump(exclude={"output_folder", "resume_run"}),
        }
        if settings.resume_run:
            self._folder = RunFolder.open(Path(settings.resume_run))
            _same(self._folder.facts(), facts)
        options = {"threads": settings.physics_threads, "autoreset_mode": "SameStep"}
        self._environment = load_target(chosen.make)(
            chosen.environment_id,
            reward_function=chosen.reward_function,
            num_envs=chosen.num_envs,
            seed=seed,
            **options,
            **({"randomise": True} if settings.randomise else {}),
        )
        if not hasattr(self._environment, "advance"):
            raise RunError(
                f"{chosen.environment_id} runs one environment after the other here; this trainer requires "
                "environments that step together: install MuJoCo 4 (Python 3.11)"
            )
        self._environment.reset(seed=seed)
        self._learner = Learner(
            settings, self._environment, seed, lambda: self.context.stopping, self._tell_steps
        )
        if self._folder is None:
            name = re.sub(
                r"[^A-Za-z0-9]+", "-", chosen.environment_id.partition("/")[2] or chosen.environment_id
            )
            about = {**facts, **described(Path(self.facts.folder or "."))}
            self._folder = RunFolder.create(Path(settings.output_folder), name, about)
            return
        whole = self._folder.checkpoints()
        if not whole:
            raise RunError(f"{self._folder.path} has no checkpoint to continue from: start a new run")
        self._learner.restore(*checkpoint.read(whole[-1]))
        self._saved = self._learner.steps
        self._folder.cut_metrics(self._learner.steps)
        self.context.log.info("continuing after %d steps from %s", self._learner.steps, whole[-1])

    def activate(self) -> None:
        """Start learning."""
        assert self._folder is not None
        self.context.log.info("this run is in %s", self._folder.path)
        self._ended.clear()
        self.context.spawn_thread(self._learn, name="learner", hang_after_s=HANG_S)

    def deactivate(self) -> None:
        """Wait for the last checkpoint."""
        if not self._ended.wait(SAVE_S):
            self.context.log.warning(
                "the learner did not stop within %g s; its last checkpoint is complete", SAVE_S
            )

    def cleanup(self) -> None:
        """Close the environments."""
        environment, self._environment = self._environment, None
        if environment is not None and self._ended.is_set():
            environment.close()

    def _learn(self) -> None:
        from torch.utils.tensorboard import SummaryWriter

        from joshua_ppo_trainer.learner import DivergedError

        folder, learner, settings = self._folder, self._learner, self._settings
        assert folder is not None
        board = SummaryWriter(str(folder.path / "tensorboard"), purge_step=learner.steps or None)
        try:
            while learner.steps < settings.total_timesteps and not self.context.stopping:
                row = learner.iterate()
                if row is None:
                    break
                folder.add_metrics(row)
                for name, value in row.items():
                    if "/" in name:
                        board.add_scalar(name, value, learner.steps)
                self.context.show(_shown(row))
                if learner.steps - max(self._saved, 0) >= settings.checkpoint_steps:
                    self._save()
            self._save()
            if learner.steps >= settings.total_timesteps:
                self.context.end_run(
                    f"{learner.steps} steps learned: {_shown(learner.metrics())}, {folder.path}"
                )
        except DivergedError as error:
            self._save()  # the state from before the error
            raise RunError(f"{error}; {self._kept_batch()}") from error
        finally:
            board.close()
            self._ended.set()

    def _save(self) -> None:
        from joshua_ppo_trainer import checkpoint

        assert self._folder is not None
        policy, training, state = self._learner.snapshot()
        if state["steps"] == self._saved:
            return
        path = self._folder.save(
            state["steps"], checkpoint.as_files(policy, training, state, self._about_policy(training))
        )
        self._saved = state["steps"]
        self.context.log.info("checkpoint %s", path)

    def _kept_batch(self) -> str:
        """Write the samples of the last update and the weights after it; return where."""
        from joshua_ppo_trainer import checkpoint

        assert self._folder is not None
        path = self._folder.write(BATCH, checkpoint.packed(self._learner.last_batch()))
        return f"the batch and the weights are in {path}"

    def _about_policy(self, training: dict[str, Any]) -> dict[str, Any]:
        """Describe the inputs and outputs of a policy, and the scaling of its inputs."""
        settings, moments = self._settings, "normalise.observed"
        seen = {key: training[f"{moments}.{key}"].tolist() for key in ("mean", "variance")}
        return {
            **_policy_facts(self.facts.environment, self._environment),
            "format": 1,
            "algorithm": settings.algorithm,
            "activation": settings.activation,
            "normalisation": seen if settings.normalize_observations else None,
        }

    def _tell_steps(self, steps: int) -> None:
        total = self._settings.total_timesteps
        self.context.progress("training", float(min(steps, total)), float(total), unit="steps")


def _shown(row: dict[str, float]) -> str:
    """Format the figures of an iteration for the status line."""
    names = (("episode/success_rate", "success", "{:.2f}"), ("episode/return", "return", "{:.1f}"))
    return ", ".join(f"{text} {form.format(row[key])}" for key, text, form in names if key in row)


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


#: Settings that a continued run may change.
_FREE = {
    *("total_timesteps", "checkpoint_steps", "physics_threads", "learning_rate"),
    *("environment", "environment_id"),
}


def _same(before: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Refuse to continue a run with other settings. Raises RunError."""
    old = {**before.get("settings", {}), **{key: before.get(key) for key in ("seed", "reward_function")}}
    new = {**wanted["settings"], **{key: wanted[key] for key in ("seed", "reward_function")}}
    different = [key for key in new if key not in _FREE and _plain(old.get(key)) != _plain(new[key])]
    if before.get("environment") != wanted["environment"]:
        different.insert(0, "environment")
    if different:
        key = different[0]
        was, is_now = (
            (before.get("environment"), wanted["environment"])
            if key == "environment"
            else (old.get(key), new[key])
        )
        raise RunError(
            f"the run was started with {key} {was}, but the file says {is_now}: "
            "continue with the settings of the run, or start a new one"
        )


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
