"""Settings of the trainer: those of PPO on the CPU, without what has no effect here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from joshua_ppo_trainer.settings import TrainerSettings


class MjxSettings(TrainerSettings):
    """Settings of a training on MuJoCo XLA."""

    BACKEND = "BACKEND_MJX"
    TRAINS_BY = ("PPO",)
    WITHOUT_EFFECT: ClassVar[Mapping[str, str]] = {"physics_threads": "JAX distributes the physics itself"}
    SPREADS = False

    @property
    def ready_timeout_s(self) -> float:
        """Time to import JAX."""
        return 600.0
