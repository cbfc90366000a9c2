"""Which environment a training block chooses: checked against what the installed plugins offer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan import Related, Severity
from joshua.planner.diagnostics import Diagnostics
from joshua.plugins import Environment, EnvironmentSpec, Registry
from joshua.schema import config_pb2 as pb
from joshua.textproto.nearest import nearest, nearest_first

if TYPE_CHECKING:
    from joshua.plan import ChosenEnvironment

_BACKEND = "ai.training.simulator_backend"
_ID = "ai.training.environment_id"
_REWARD = "ai.training.rl_config.reward_function"

Offers = tuple[tuple[Environment, EnvironmentSpec], ...]


def choose_environment(
    config: pb.Config, registry: Registry, findings: Diagnostics
) -> ChosenEnvironment | None:
    """Chooses the environment of ``ai.training`` by its id, else by its reward; problems become findings.

    Returns:
        None where the training needs none, and where none can be told.
    """
    training = config.ai.training
    if not config.ai.HasField("training") or training.environment != pb.ENV_SIMULATION:
        return None
    if training.method not in (pb.METHOD_RL, pb.METHOD_EVAL) or training.HasField("plugin_config"):
        return None
    if any(map(findings.positions.is_broken, (_BACKEND, _ID, _REWARD))):
        return None  # loading has said so, and what was meant is not known
    backend = training.simulator_backend
    offers = registry.environments(pb.SimulatorBackend.Name(backend) if backend else "")
    reward = training.rl_config.reward_function
    if not offers:
        _nobody_offers(training, registry, findings)
        return None
    if training.environment_id:
        fitting = tuple(offer for offer in offers if offer[0].id == training.environment_id)
    elif reward:
        fitting = tuple(offer for offer in offers if reward in offer[0].rewards)
    elif training.method == pb.METHOD_EVAL:  # the checkpoint may know where it was trained
        return None
    else:
        if backend:  # without one, that is what is missing first
            _needed(offers, findings)
        return None
    if not fitting:
        _unknown(training, offers, findings)
        return None
    environment, spec = fitting[0]
    if reward and reward not in environment.rewards:
        _unknown_reward(reward, environment, findings)
        return None
    if len(fitting) > 1:
        _needed(fitting, findings)
        return None
    from joshua.plan import ChosenEnvironment

    return ChosenEnvironment(
        environment_id=environment.id,
        reward_function=reward or environment.rewards[0],
        num_envs=training.rl_config.num_envs or 1,
        seed=config.simulation.seed if config.simulation.HasField("seed") else None,
        make=spec.implementation,
    )


def _nobody_offers(training: pb.Training, registry: Registry, findings: Diagnostics) -> None:
    """No installed plugin offers any: only an id that is named is certain to need one."""
    if training.environment_id and training.simulator_backend in (0, pb.BACKEND_MJX):
        findings.add(
            "plugin-missing",
            Severity.ERROR if findings.launch else Severity.NOTE,
            registry.missing(training.environment_id, EnvironmentSpec, "simulation"),
            _ID,
            remedy="install the plugin that offers the environment",
        )


def _unknown(training: pb.Training, offers: Offers, findings: Diagnostics) -> None:
    wanted = training.environment_id
    if wanted:
        known = [environment.id for environment, _ in offers]
        code, path, text = (
            "environment-unknown",
            _ID,
            f"No installed plugin offers the environment {wanted!r}",
        )
    else:
        wanted = training.rl_config.reward_function
        known = [name for environment, _ in offers for name in environment.rewards]
        code, path, text = "reward-unknown", _REWARD, f"No environment offers the reward {wanted!r}"
    near = nearest(wanted, known)
    findings.add(
        code,
        Severity.ERROR,
        text,
        path,
        found=f'"{wanted}"',
        allowed=tuple(nearest_first(wanted, known)),
        remedy=f"did you mean {near[0]}?"
        if near
        else "name one of these, or install the plugin that offers it",
    )


def _unknown_reward(reward: str, environment: Environment, findings: Diagnostics) -> None:
    near = nearest(reward, environment.rewards)
    place = findings.positions.value(_ID)
    findings.add(
        "reward-unknown",
        Severity.ERROR,
        f"The environment {environment.id} offers no reward {reward!r}",
        _REWARD,
        found=f'"{reward}"',
        allowed=tuple(nearest_first(reward, environment.rewards)),
        remedy=f"did you mean {near[0]}?" if near else "name one of these, or another environment_id",
        related=(Related(position=place, label="environment"),) if place else (),
    )


def _needed(offers: Offers, findings: Diagnostics) -> None:
    findings.add(
        "environment-needed",
        Severity.ERROR if findings.launch else Severity.NOTE,
        "The training does not say which task is learned",
        "ai.training",
        allowed=tuple(environment.id for environment, _ in offers),
        remedy=f'add environment_id: "{offers[0][0].id}", or another one',
    )
