"""Chooses the environment of a training block, from those of the installed plugins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from joshua.plugins import Environment, EnvironmentSpec
from joshua.schema import config_pb2 as pb
from joshua.textproto.nearest import nearest, nearest_first

if TYPE_CHECKING:
    from joshua.plan import ChosenEnvironment, Diagnostic
    from joshua.planner.draft import Draft

_BACKEND = "ai.training.simulator_backend"
_ID = "ai.training.environment_id"
_REWARD = "ai.training.rl_config.reward_function"

Offers = Sequence[tuple[Environment, EnvironmentSpec]]


def choose_environment(draft: Draft) -> ChosenEnvironment | None:
    """Choose the environment of ``ai.training`` by its id, else by its reward. Problems become findings.

    Returns:
        None if the training needs none, or if it cannot be determined.
    """
    training, simulation = draft.config.ai.training, draft.config.simulation
    if not draft.config.ai.HasField("training") or training.environment != pb.ENV_SIMULATION:
        return None
    if training.method not in (pb.METHOD_RL, pb.METHOD_EVAL) or training.HasField("plugin_config"):
        return None
    if any(map(draft.loaded.positions.is_broken, (_BACKEND, _ID, _REWARD))):
        return None  # loading has reported it, and the intended value is unknown
    found = _chosen(draft, training)
    if not isinstance(found, tuple):
        draft.findings += [found] if found is not None else []
        return None
    from joshua.plan import ChosenEnvironment

    environment, spec = found
    return ChosenEnvironment(
        environment_id=environment.id,
        reward_function=training.rl_config.reward_function or environment.rewards[0],
        num_envs=training.rl_config.num_envs or 1,
        seed=simulation.seed if simulation.HasField("seed") else None,
        make=spec.implementation,
    )


def _chosen(draft: Draft, training: pb.Training) -> tuple[Environment, EnvironmentSpec] | Diagnostic | None:
    """The matching environment, or why none matches; None if none is requested."""
    backend, wanted = training.simulator_backend, training.environment_id
    reward = training.rl_config.reward_function
    offers = draft.registry.environments(pb.SimulatorBackend.Name(backend) if backend else "")
    if not offers:
        if not wanted or backend not in (0, pb.BACKEND_MJX, pb.BACKEND_MUJOCO):
            return None  # only an explicit id certainly needs one
        message = draft.registry.missing(wanted, EnvironmentSpec, "simulation")
        return draft.missing("plugin-missing", message, _ID, remedy="Install the plugin that offers it")
    if wanted:
        fitting = [offer for offer in offers if offer[0].id == wanted]
    elif reward:
        fitting = [offer for offer in offers if reward in offer[0].rewards]
    elif backend and training.method != pb.METHOD_EVAL:
        return _needed(draft, offers)
    else:
        return None  # the checkpoint may name its environment; a check reports a missing backend
    if not fitting:
        if wanted:
            ids = [environment.id for environment, _ in offers]
            message = f"No installed plugin offers the environment {wanted!r}"
            return _unknown(draft, "environment-unknown", message, _ID, wanted, ids)
        names = [name for environment, _ in offers for name in environment.rewards]
        message = f"No environment offers the reward {reward!r}"
        return _unknown(draft, "reward-unknown", message, _REWARD, reward, names)
    environment = fitting[0][0]
    if reward and reward not in environment.rewards:
        message = f"The environment {environment.id} offers no reward {reward!r}"
        return _unknown(draft, "reward-unknown", message, _REWARD, reward, environment.rewards)
    return _needed(draft, fitting) if len(fitting) > 1 else fitting[0]


def _unknown(
    draft: Draft, code: str, message: str, path: str, wanted: str, known: Sequence[str]
) -> Diagnostic:
    near = nearest(wanted, known)
    remedy = f"Did you mean {near[0]}?" if near else ""
    related = draft.see(_ID, "environment") if path != _ID and draft.loaded.positions.is_set(_ID) else ()
    allowed = tuple(nearest_first(wanted, known))
    return draft.error(code, message, path, allowed=allowed, remedy=remedy, related=related)


def _needed(draft: Draft, offers: Offers) -> Diagnostic:
    message = "The training does not say which task is learned"
    allowed = tuple(environment.id for environment, _ in offers)
    remedy = f'Add environment_id: "{allowed[0]}", or another one'
    return draft.missing("environment-needed", message, "ai.training", allowed=allowed, remedy=remedy)
