"""Settings of the trainer: those of PPO on the CPU, without what has no effect here."""

from __future__ import annotations

from joshua.api import FieldError
from joshua_ppo_trainer.settings import TrainerSettings
from pydantic import model_validator
from typing_extensions import Self

#: How long a stop waits for the last files.
SAVE_S = 20.0


class MjxSettings(TrainerSettings):
    """Settings of a training on MuJoCo XLA."""

    @property
    def ready_timeout_s(self) -> float:
        """Time to import JAX."""
        return 600.0

    @property
    def stop_timeout_s(self) -> float:
        """Time to end the steps that JAX computes at once, and to write the last checkpoint."""
        return SAVE_S + 10.0

    @model_validator(mode="after")
    def _has_effect(self) -> Self:
        if self.algorithm == "SAC":
            raise FieldError(
                "rl_config.algorithm",
                "BACKEND_MJX trains by PPO only",
                allowed=("PPO",),
                remedy='write algorithm: "PPO", or simulator_backend: BACKEND_MUJOCO',
            )
        if self.physics_threads:
            raise FieldError(
                "rl_config.physics_threads",
                "physics_threads has no effect with BACKEND_MJX, because JAX distributes the physics itself",
                remedy="remove it",
            )
        return self
