"""Gymnasium environments. Importing this package registers them, as does ``gymnasium`` by itself."""

from __future__ import annotations

import importlib.util
from typing import Any

import gymnasium

from joshua_mujoco_sim.envs.single import TermEnv
from joshua_mujoco_sim.envs.tasks import TASKS
from joshua_mujoco_sim.envs.vector import TermVectorEnv

__all__ = ["TASKS", "TermEnv", "TermVectorEnv", "make_environment", "make_vector_environment", "register"]


def register() -> None:
    """Register the environments under ``joshua/``. Idempotent."""
    for name, task in TASKS.items():
        if name in gymnasium.registry:
            continue
        gymnasium.register(
            id=name,
            entry_point="joshua_mujoco_sim.envs.single:TermEnv",
            vector_entry_point="joshua_mujoco_sim.envs.vector:TermVectorEnv",
            max_episode_steps=task().max_steps,
            kwargs={"task": task},
        )


def make_environment(environment_id: str, reward_function: str = "", **options: Any) -> Any:
    """Make an environment as trainers do.

    Args:
        environment_id: such as ``joshua/SoArm100Reach-v0``.
        reward_function: name of a reward of its task; "" for the default.
        options: further arguments of ``gymnasium.make``.

    Raises:
        ValueError: the id or the reward is unknown; lists those that are known.
    """
    if environment_id not in TASKS and environment_id not in gymnasium.registry:
        raise ValueError(f"no environment {environment_id!r}: choose {', '.join(TASKS)}")
    if reward_function:
        options["reward_function"] = reward_function
    return gymnasium.make(environment_id, **options)


def make_vector_environment(
    environment_id: str,
    *,
    reward_function: str = "",
    num_envs: int = 1,
    seed: int | None = None,
    **options: Any,
) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    """Make many environments at once, as the training block of a file chooses them.

    They run on all cores where MuJoCo 4 is installed, else one after the other.

    Args:
        environment_id: such as ``joshua/SoArm100Reach-v0``.
        reward_function: name of a reward of its task; "" for the default.
        num_envs: how many; seed: of the first one, the k-th has ``seed + k``; None for none in particular.
        options: further arguments of the environment, such as ``randomise=True``, and of the vector, such as
            ``autoreset_mode``. ``threads`` has no effect where they run one after the other.

    Raises:
        ValueError: the id or the reward is unknown; lists those that are known.
    """
    if environment_id not in TASKS and environment_id not in gymnasium.registry:
        raise ValueError(f"no environment {environment_id!r}: choose {', '.join(TASKS)}")
    if reward_function:
        options["reward_function"] = reward_function
    together = importlib.util.find_spec("mujoco.batch") is not None
    if together:
        mode, vector = "vector_entry_point", None
    else:
        # a single environment knows neither: there the vector of Gymnasium restarts episodes, on one thread
        mode = "sync"
        vector = {"autoreset_mode": options.pop("autoreset_mode", "NextStep")}
        options.pop("threads", None)
    made = gymnasium.make_vec(
        environment_id, num_envs=num_envs, vectorization_mode=mode, vector_kwargs=vector, **options
    )
    made.reset(seed=seed)
    return made


register()
