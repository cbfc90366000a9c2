"""Settings of the trainer: the fields of ``rl_config``, and what they become in rsl_rl and Isaac Lab."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from joshua.api import FieldError, FieldErrors
from joshua_training.rl_settings import SAC_ONLY, RlSettings, Suitable
from pydantic import model_validator
from typing_extensions import Self

from joshua_isaac_trainer.machine import lacks, look

#: Tasks that this trainer builds in Isaac Lab.
TASKS = ("joshua/SoArm100Reach-v0", "joshua/SoArm100PickPlace-v0")


class IsaacSettings(RlSettings):
    """Settings of a training in Isaac Lab."""

    BACKEND = "BACKEND_ISAAC"
    WITHOUT_EFFECT: ClassVar[Mapping[str, str]] = {
        "physics_threads": "PhysX computes on the GPU",
        **dict.fromkeys(SAC_ONLY, "it belongs to SAC"),
    }
    #: Those of rsl_rl in Isaac Lab's tasks of arms.
    OTHERWISE = Suitable(
        n_steps=24,
        hidden_sizes=(128, 128),
        activation="elu",
        normalize_observations=False,
        normalize_rewards=False,
    )

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: Any) -> dict[str, Any]:
        """Take the fields of the block, and the defaults, which are those of any task here."""
        known = super().si_values(values, node, context)
        return vars(cls.OTHERWISE) | {k: value for k, value in known.items() if value not in ((), [], "")}

    @model_validator(mode="after")
    def _can_run(self) -> Self:
        if self.environment_id and self.environment_id not in TASKS:
            raise FieldError(
                "environment_id",
                f"{self.environment_id} is not built for Isaac Lab",
                allowed=TASKS,
                remedy="choose one of them, or BACKEND_MUJOCO",
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
        return max(1, round(self.collected / self.batch_size))

    def runner(self) -> dict[str, Any]:
        """Return the configuration of rsl_rl's runner."""
        return {
            "num_steps_per_env": self.n_steps,
            "save_interval": 1_000_000,  # checkpoints are written by JOSHUA
            "obs_groups": {"policy": ["policy"], "critic": ["policy"]},
            "policy": {
                "class_name": "ActorCritic",
                "init_noise_std": math.exp(self.initial_log_std or 0.0),
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
