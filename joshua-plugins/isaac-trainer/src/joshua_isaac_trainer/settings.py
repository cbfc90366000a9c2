"""Settings of the trainer: the fields of ``rl_config``, and what they become in rsl_rl and Isaac Lab."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from joshua.api import FieldError, FieldErrors
from joshua_training.settings import RunSettings
from pydantic import model_validator
from typing_extensions import Self

from joshua_isaac_trainer.machine import lacks, look

#: Tasks that this trainer builds in Isaac Lab.
TASKS = ("joshua/SoArm100Reach-v0", "joshua/SoArm100PickPlace-v0")

#: Fields that have no effect here, and why.
WITHOUT_EFFECT: Mapping[str, str] = {
    "physics_threads": "PhysX computes on the GPU",
    "buffer_size": "it belongs to SAC",
    "learning_starts": "it belongs to SAC",
    "tau": "it belongs to SAC",
    "updates_per_step": "it belongs to SAC",
}

#: Defaults for fields that the file omits: those of rsl_rl in Isaac Lab's tasks of arms.
N_STEPS, N_EPOCHS = 24, 8


class IsaacSettings(RunSettings):
    """Settings of a training in Isaac Lab."""

    BLOCK = "rl_config"
    REQUIRED = ("algorithm", "num_envs", "total_timesteps", "learning_rate", "batch_size")

    algorithm: str = "PPO"
    num_envs: int = 1
    total_timesteps: int = 1
    learning_rate: float = 3e-4
    gamma: float = 0.99
    clip_range: float = 0.2
    batch_size: int = 64
    n_steps: int = N_STEPS
    n_epochs: int = N_EPOCHS
    gae_lambda: float = 0.95
    entropy_weight: float = 0.0
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float | None = None
    hidden_sizes: tuple[int, ...] = (128, 128)
    activation: str = "elu"
    initial_log_std: float = -0.5
    normalize_observations: bool = False
    normalize_rewards: bool = False
    randomise: bool = False
    checkpoint_steps: int = 100_000
    without_effect: tuple[str, ...] = ()

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: Any) -> dict[str, Any]:
        """Take the fields of the block; remember those without effect, to refuse them."""
        known = super().si_values(values, node, context)
        known = {name: value for name, value in known.items() if value not in ((), [], "")}
        block: Mapping[str, Any] = values[cls.BLOCK] or {}
        idle = [name for name in WITHOUT_EFFECT if block.get(name) not in (None, 0, _default(name))]
        return known | {"without_effect": tuple(idle)}

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.environment == "ENV_REAL":
            raise FieldError(
                "environment",
                "BACKEND_ISAAC is a simulator, and ENV_REAL is the robot",
                allowed=("ENV_SIMULATION",),
                remedy="write environment: ENV_SIMULATION",
            )
        if self.algorithm != "PPO":
            raise FieldError(
                "rl_config.algorithm",
                f"There is no algorithm {self.algorithm!r} with BACKEND_ISAAC",
                allowed=("PPO",),
                remedy='write algorithm: "PPO"',
            )
        for name in self.without_effect:
            raise FieldError(
                f"rl_config.{name}",
                f"{name} has no effect with BACKEND_ISAAC: {WITHOUT_EFFECT[name]}",
                remedy=f"remove {name}",
            )
        if self.environment_id and self.environment_id not in TASKS:
            raise FieldError(
                "environment_id",
                f"{self.environment_id} is not built for Isaac Lab",
                allowed=TASKS,
                remedy="choose one of them, or BACKEND_MUJOCO",
            )
        if self.batch_size > self.num_envs * self.n_steps:
            raise FieldError(
                "rl_config.batch_size",
                f"A batch of {self.batch_size} samples is larger than what {self.num_envs} environments "
                f"collect in {self.n_steps} steps, {self.num_envs * self.n_steps}",
                remedy="make it smaller, or raise num_envs or n_steps",
            )
        if self.launching and (found := tuple(lacks(look()))):
            raise FieldErrors(
                [
                    FieldError("simulator_backend", lack.message, remedy=lack.remedy, code=lack.code)
                    for lack in found
                ]
            )
        return self

    @property
    def mini_batches(self) -> int:
        """Mini-batches of a pass, of about ``batch_size`` samples each: rsl_rl divides into equal ones."""
        return max(1, round(self.num_envs * self.n_steps / self.batch_size))

    def runner(self) -> dict[str, Any]:
        """Return the configuration of rsl_rl's runner."""
        return {
            "num_steps_per_env": self.n_steps,
            "save_interval": 1_000_000,  # checkpoints are written by JOSHUA
            "obs_groups": {"policy": ["policy"], "critic": ["policy"]},
            "policy": {
                "class_name": "ActorCritic",
                "init_noise_std": math.exp(self.initial_log_std),
                "noise_std_type": "log",
                "actor_obs_normalization": self.normalize_observations,
                "critic_obs_normalization": self.normalize_observations,
                "actor_hidden_dims": list(self.hidden_sizes),
                "critic_hidden_dims": list(self.hidden_sizes),
                "activation": self.activation,
            },
            "algorithm": {
                "class_name": "PPO",
                "num_learning_epochs": self.n_epochs,
                "num_mini_batches": self.mini_batches,
                "learning_rate": self.learning_rate,
                # rsl_rl does not stop an update early: it changes the learning rate to keep the divergence
                "schedule": "adaptive" if self.target_kl is not None else "fixed",
                "desired_kl": self.target_kl,
                "gamma": self.gamma,
                "lam": self.gae_lambda,
                "clip_param": self.clip_range,
                "entropy_coef": self.entropy_weight,
                "value_loss_coef": self.value_weight,
                "use_clipped_value_loss": False,
                "max_grad_norm": self.max_grad_norm,
                "normalize_advantage_per_mini_batch": True,
            },
        }


def _default(name: str) -> Any:
    return {"buffer_size": 300_000, "learning_starts": 5_000, "tau": 0.005, "updates_per_step": 8}.get(name)
