"""Settings of the trainer: the fields of ``rl_config``, and the defaults of each environment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from joshua.api import FieldError
from joshua_training.settings import RunSettings
from pydantic import model_validator
from typing_extensions import Self

ALGORITHMS = ("PPO", "SAC")

#: Fields that one of the algorithms alone reads.
PPO_ONLY = (
    *("clip_range", "n_steps", "n_epochs", "gae_lambda", "entropy_weight", "value_weight"),
    *("max_grad_norm", "target_kl", "initial_log_std"),
)
SAC_ONLY = ("buffer_size", "learning_starts", "tau", "updates_per_step")


@dataclass(frozen=True)
class Suitable:
    """Defaults of an environment for fields that the file omits."""

    n_steps: int = 32
    n_epochs: int = 8
    gae_lambda: float = 0.95
    entropy_weight: float = 0.0
    hidden_sizes: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    initial_log_std: float = -0.5
    normalize_observations: bool = True
    normalize_rewards: bool = True


#: Defaults by environment id. Environments of the arm scale their observations and rewards themselves.
SUITABLE: Mapping[str, Suitable] = {
    "joshua/SoArm100Reach-v0": Suitable(normalize_observations=False, normalize_rewards=False),
    "joshua/SoArm100PickPlace-v0": Suitable(
        n_steps=64, hidden_sizes=(128, 128), normalize_observations=False, normalize_rewards=True
    ),
    "joshua/Ant-v0": Suitable(n_steps=64, n_epochs=10, initial_log_std=-1.0),
}


class TrainerSettings(RunSettings):
    """Settings of a training; None leaves a choice to the environment."""

    BLOCK = "rl_config"
    REQUIRED = ("algorithm", "num_envs", "total_timesteps", "learning_rate", "batch_size")

    algorithm: str = "PPO"
    num_envs: int = 1
    total_timesteps: int = 1
    learning_rate: float = 3e-4
    gamma: float = 0.99
    clip_range: float = 0.2
    batch_size: int = 64
    n_steps: int | None = None
    n_epochs: int | None = None
    gae_lambda: float | None = None
    entropy_weight: float | None = None
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float | None = None
    hidden_sizes: tuple[int, ...] = ()
    activation: str = ""
    initial_log_std: float | None = None
    normalize_observations: bool | None = None
    normalize_rewards: bool | None = None
    randomise: bool = False
    checkpoint_steps: int = 100_000
    physics_threads: int = 0
    buffer_size: int = 300_000
    learning_starts: int = 5_000
    tau: float = 0.005
    updates_per_step: int = 8

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.environment == "ENV_REAL":
            raise FieldError(
                "environment",
                "JOSHUA runs no reinforcement learning on a robot: it explores by random motions, takes "
                "thousands of episodes, and requires someone to reset the scene and judge success after "
                "each",
                allowed=("ENV_SIMULATION",),
                remedy="train in simulation, or from demonstrations with METHOD_IMITATION",
            )
        if self.algorithm not in ALGORITHMS:
            raise FieldError(
                "rl_config.algorithm",
                f"There is no algorithm {self.algorithm!r}",
                allowed=_nearest(self.algorithm),
                remedy=f'write algorithm: "{_nearest(self.algorithm)[0]}"',
            )
        others = SAC_ONLY if self.algorithm == "PPO" else PPO_ONLY
        for name in others:
            if _differ(getattr(self, name), type(self).model_fields[name].default):
                algorithm = "SAC" if self.algorithm == "PPO" else "PPO"
                raise FieldError(
                    f"rl_config.{name}",
                    f"{name} has no effect with {self.algorithm}; it belongs to {algorithm}",
                    remedy=f'remove {name}, or write algorithm: "{algorithm}"',
                )
        if self.environment_id or self.n_steps:
            self.suitable(self.environment_id).check_batch()
        return self

    def check_batch(self) -> None:
        """Refuse a mini-batch of one, or that never fills, once ``n_steps`` is known. Raises FieldError."""
        if self.algorithm == "PPO" and self.batch_size < 2:
            raise FieldError(
                "rl_config.batch_size",
                "PPO brings the advantages of a mini-batch to unit size, which one sample has not",
                remedy="write 2 or more, 1024 for example",
            )
        collected = (self.n_steps or 0) * self.num_envs
        if self.algorithm == "PPO" and self.batch_size > collected:
            raise FieldError(
                "rl_config.batch_size",
                f"A batch of {self.batch_size} samples is larger than what {self.num_envs} environments "
                f"collect in {self.n_steps} steps, {collected}",
                remedy="make it smaller, or raise num_envs or n_steps",
            )

    def halves(self) -> str:
        """Say what halves the memory of the training."""
        if self.algorithm == "SAC":
            return f"halve buffer_size, to {max(1, self.buffer_size // 2)}"
        return f"halve num_envs, to {max(1, self.num_envs // 2)}, or n_steps"

    def suitable(self, environment_id: str) -> Self:
        """Return the settings, completed by the defaults of an environment."""
        found = SUITABLE.get(environment_id, Suitable())
        open_fields = {
            name: value for name, value in vars(found).items() if getattr(self, name) in (None, (), "")
        }
        return self.model_copy(update=open_fields)


def _differ(value: float | None, default: float | None) -> bool:
    """Whether a value is not the default, which fields of 32 bits hold inexactly."""
    if value is None or default is None:
        return value is not default
    return not math.isclose(value, default, rel_tol=1e-6)


def _nearest(name: str) -> tuple[str, ...]:
    close = get_close_matches(name.upper(), ALGORITHMS, n=1, cutoff=0.4)
    return (*close, *(known for known in ALGORITHMS if known not in close))
