"""How a trainer gets the environment that its training block chooses."""

from __future__ import annotations

from typing import Any

from joshua.plan.facts import ServiceFacts
from joshua.plugins.targets import load_target


def make_environment(facts: ServiceFacts, *, num_envs: int = 0) -> Any:
    """Makes the ``gymnasium.vector.VectorEnv`` of a plan, seeded where the file has a seed.

    Args:
        facts: of the trainer's node; num_envs: another number than the file's, 0 for the file's.

    Raises:
        ValueError: the plan has no environment; TargetError: the plugin that offers it cannot be imported.
    """
    chosen = facts.environment
    if chosen is None:
        raise ValueError("the plan has no environment: the file trains on a robot or from a data set")
    return load_target(chosen.make)(
        chosen.environment_id,
        reward_function=chosen.reward_function,
        num_envs=num_envs or chosen.num_envs,
        seed=chosen.seed,
    )
