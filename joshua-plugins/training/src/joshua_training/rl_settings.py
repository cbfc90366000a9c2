"""Settings that all trainers by reinforcement share: the fields of ``rl_config``, with their checks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import ClassVar

from joshua.api import FieldError
from pydantic import model_validator
from typing_extensions import Self

from joshua_training.settings import RunSettings

#: Algorithms that some trainer knows.
ALGORITHMS = ("PPO", "SAC")

#: Fields that one of the algorithms alone reads.
PPO_ONLY = (
    *("clip_range", "n_steps", "n_epochs", "gae_lambda", "entropy_weight", "value_weight"),
    *("max_grad_norm", "target_kl", "initial_log_std"),
)
SAC_ONLY = ("buffer_size", "learning_starts", "tau", "updates_per_step")


@dataclass(frozen=True)
class Suitable:
    """Defaults of an environment for fields that the file omits, with PPO."""

    n_steps: int = 32
    n_epochs: int = 8
    gae_lambda: float = 0.95
    entropy_weight: float = 0.0
    hidden_sizes: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    initial_log_std: float = -0.5
    normalize_observations: bool = True
    normalize_rewards: bool = True


@dataclass(frozen=True)
class SuitableSac:
    """Defaults of an environment for fields that the file omits, with SAC."""

    hidden_sizes: tuple[int, ...] = (256, 256)
    activation: str = "relu"
    normalize_observations: bool = True
    normalize_rewards: bool = False
    learning_starts: int = 5_000


class RlSettings(RunSettings):
    """Settings of a training by reinforcement; None leaves a choice to the environment.

    A trainer derives from it, and says what of it does not apply.
    """

    BLOCK = "rl_config"
    REQUIRED = ("algorithm", "num_envs", "total_timesteps", "learning_rate", "batch_size")

    #: Simulator of the trainer, and the algorithms that it knows.
    BACKEND: ClassVar[str]
    TRAINS_BY: ClassVar[tuple[str, ...]] = ("PPO",)

    #: Fields that have no effect with the trainer, and the reason.
    WITHOUT_EFFECT: ClassVar[Mapping[str, str]] = {}

    #: Defaults by environment id, and those of all other environments, with each algorithm.
    SUITABLE: ClassVar[Mapping[str, Suitable]] = {}
    OTHERWISE: ClassVar[Suitable] = Suitable()
    SUITABLE_SAC: ClassVar[Mapping[str, SuitableSac]] = {}
    OTHERWISE_SAC: ClassVar[SuitableSac] = SuitableSac()

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
    learning_starts: int | None = None
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
        self._check_algorithm()
        for name, reason in self.WITHOUT_EFFECT.items():
            if self._is_given(name):
                raise FieldError(
                    f"rl_config.{name}",
                    f"{name} has no effect with {self.BACKEND}, because {reason}",
                    remedy=f"remove {name}",
                )
        other = "SAC" if self.algorithm == "PPO" else "PPO"
        for name in self.foreign:
            if self._is_given(name):
                raise FieldError(
                    f"rl_config.{name}",
                    f"{name} has no effect with {self.algorithm}; it belongs to {other}",
                    remedy=f'remove {name}, or write algorithm: "{other}"',
                )
        if self.environment_id or self.n_steps:
            self.suitable(self.environment_id).check_batch()
        return self

    @property
    def collected(self) -> int:
        """Samples that all environments collect for an update, once ``n_steps`` is known."""
        return (self.n_steps or 0) * self.num_envs

    def check_batch(self) -> None:
        """Refuse a mini-batch of one, or that never fills, once ``n_steps`` is known. Raises FieldError."""
        if self.algorithm == "PPO" and self.batch_size < 2:
            raise FieldError(
                "rl_config.batch_size",
                "PPO brings the advantages of a mini-batch to unit size, which one sample has not",
                remedy="write 2 or more, 1024 for example",
            )
        if self.algorithm == "PPO" and self.batch_size > self.collected:
            raise FieldError(
                "rl_config.batch_size",
                f"A batch of {self.batch_size} samples is larger than what {self.num_envs} environments "
                f"collect in {self.n_steps} steps, {self.collected}",
                remedy="make it smaller, or raise num_envs or n_steps",
            )

    def halves(self) -> str:
        """Say what halves the memory of the training."""
        if self.algorithm == "SAC":
            return f"halve buffer_size, to {max(1, self.buffer_size // 2)}"
        return f"halve num_envs, to {max(1, self.num_envs // 2)}, or n_steps"

    @property
    def foreign(self) -> tuple[str, ...]:
        """Fields that only the other algorithm reads, so they are no facts of a run."""
        return SAC_ONLY if self.algorithm == "PPO" else PPO_ONLY

    def suitable(self, environment_id: str) -> Self:
        """Return the settings, completed by the defaults of an environment."""
        found: Suitable | SuitableSac
        if self.algorithm == "SAC":
            found = self.SUITABLE_SAC.get(environment_id, self.OTHERWISE_SAC)
        else:
            found = self.SUITABLE.get(environment_id, self.OTHERWISE)
        open_fields = {
            name: value for name, value in vars(found).items() if getattr(self, name) in (None, (), "")
        }
        return self.model_copy(update=open_fields)

    def _check_algorithm(self) -> None:
        name = self.algorithm
        if name in self.TRAINS_BY:
            return
        near = get_close_matches(name.upper(), self.TRAINS_BY, n=1, cutoff=0.4)
        allowed = (*near, *(known for known in self.TRAINS_BY if known not in near))
        remedy = f'write algorithm: "{allowed[0]}"'
        if name in ALGORITHMS:
            message = f"{self.BACKEND} trains by {' and '.join(allowed)} only"
            remedy += ", or simulator_backend: BACKEND_MUJOCO"
        else:
            message = f"There is no algorithm {name!r}"
        raise FieldError("rl_config.algorithm", message, allowed=allowed, remedy=remedy)

    def _is_given(self, name: str) -> bool:
        """Whether a value is not the default, which fields of 32 bits hold inexactly."""
        value, default = getattr(self, name), type(self).model_fields[name].default
        if value is None or default is None:
            return value is not default
        return not math.isclose(value, default, rel_tol=1e-6)
