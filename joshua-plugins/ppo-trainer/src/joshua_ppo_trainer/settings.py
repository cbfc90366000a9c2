"""Settings of the trainer: the fields of ``rl_config``, with the defaults of each environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from joshua.api import FieldError
from joshua_training.rl_settings import RlSettings, Suitable, SuitableSac
from pydantic import model_validator
from typing_extensions import Self


class TrainerSettings(RlSettings):
    """Settings of a training by PPO or SAC on the CPU."""

    BACKEND = "BACKEND_MUJOCO"
    SPREADS = True
    TRAINS_BY: ClassVar[tuple[str, ...]] = ("PPO", "SAC")

    # environments of the arm scale their observations themselves, and reaching its rewards, too
    SUITABLE: ClassVar[Mapping[str, Suitable]] = {
        "joshua/SoArm100Reach-v0": Suitable(normalize_observations=False, normalize_rewards=False),
        "joshua/SoArm100PickPlace-v0": Suitable(
            n_steps=64, hidden_sizes=(128, 128), normalize_observations=False
        ),
        "joshua/Ant-v0": Suitable(n_steps=64, n_epochs=10, initial_log_std=-1.0),
    }
    SUITABLE_SAC: ClassVar[Mapping[str, SuitableSac]] = {
        "joshua/SoArm100Reach-v0": SuitableSac(
            hidden_sizes=(64, 64), normalize_observations=False, learning_starts=1_000
        ),
        "joshua/SoArm100PickPlace-v0": SuitableSac(normalize_observations=False),
    }

    @model_validator(mode="after")
    def _leaves_a_cluster_work(self) -> Self:
        if self.cluster and self.algorithm != "PPO":
            raise FieldError(
                "cluster",
                f"{self.algorithm} updates after every step, which leaves nothing for a cluster to do",
                remedy='remove it, or write algorithm: "PPO"',
            )
        if self.cluster and self.physics_threads > 1:
            raise FieldError(
                "rl_config.physics_threads",
                "physics_threads has no effect on a cluster, because each of its workers has one core",
                remedy="remove physics_threads; cluster.workers is the number of cores",
            )
        return self
