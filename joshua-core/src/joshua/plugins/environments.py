"""The environment that a training block chooses, and how a trainer gets it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from joshua.plugins.targets import load_target


@dataclass(frozen=True)
class ChosenEnvironment:
    """What the file says about the environment, checked; ``NodeSpec.context["environment"]`` of a trainer.

    Attributes:
        environment_id: such as ``joshua/SoArm100Reach-v0``; reward_function: one that it offers, never "".
        num_envs: how many step at once; seed: of the first one, None for none in particular.
        make: import string of what makes it, see ``EnvironmentSpec``.
    """

    environment_id: str
    reward_function: str
    num_envs: int
    seed: int | None
    make: str

    def as_context(self) -> dict[str, Any]:
        """Plain values, for the plan."""
        return asdict(self)


def make_environment(context: Mapping[str, Any], *, num_envs: int = 0) -> Any:
    """Makes the environment of a plan: vectorised, and seeded where the file has a seed.

    Args:
        context: of the trainer's node; num_envs: another number than the file's, 0 for the file's.

    Returns:
        A ``gymnasium.vector.VectorEnv``. Its first ``reset()`` needs no seed of its own.

    Raises:
        KeyError: the plan has no environment, since the file trains on a robot or from a data set.
        TargetError: the plugin that offers it cannot be imported.
    """
    chosen = ChosenEnvironment(**context["environment"])
    return load_target(chosen.make)(
        chosen.environment_id,
        reward_function=chosen.reward_function,
        num_envs=num_envs or chosen.num_envs,
        seed=chosen.seed,
    )
