"""Terms that fit any robot."""

from __future__ import annotations

from typing import Any

import numpy as np

from joshua_mujoco_sim.envs.state import IntArray, State, square_sum
from joshua_mujoco_sim.envs.terms import Generators


def columns(state: State, *, qpos: Any = slice(None)) -> Any:
    """Some columns of the positions, shape (N, k)."""
    return state.qpos[:, qpos]


def velocities(state: State, *, qvel: Any = slice(None)) -> Any:
    """Some columns of the speeds, shape (N, k)."""
    return state.qvel[:, qvel]


def lead(state: State, *, qpos: Any = slice(None)) -> Any:
    """Return the lead of each command over its joint, shape (N, k)."""
    return state.ctrl - state.qpos[:, qpos]


def site_position(state: State, *, site: str) -> Any:
    """Where a site is, m, shape (N, 3)."""
    return state.site(site)


def last_action(state: State) -> Any:
    """Return the last action of the policy, shape (N, A)."""
    return state.action


def alive(state: State) -> Any:
    """Return 1 for each step."""
    return state.xp.ones(state.count)


def action_size(state: State) -> Any:
    """Sum of the squared action."""
    return square_sum(state.action)


def action_change(state: State) -> Any:
    """Sum of the squared change of the action."""
    return square_sum(state.action - state.last_action)


def joint_speed(state: State, *, qvel: Any = slice(None)) -> Any:
    """Sum of the squared joint speeds, (rad/s)²."""
    return square_sum(state.qvel[:, qvel])


def not_finite(state: State) -> Any:
    """Return whether the simulation has diverged."""
    return ~state.xp.isfinite(state.qvel.sum(axis=1))


def noisy_joints(
    state: State,
    ids: IntArray,
    generators: Generators,
    *,
    qpos: Any = slice(None),
    qvel: Any = slice(None),
    position_rad: float = 0.0,
    velocity_rad_s: float = 0.0,
) -> None:
    """Start with uniform noise on the joints of the keyframe."""
    for index, generator in zip(ids, generators, strict=True):
        target = state.qpos[index, qpos]
        state.qpos[index, qpos] = target + generator.uniform(-position_rad, position_rad, target.shape)
        speed = state.qvel[index, qvel]
        state.qvel[index, qvel] = speed + generator.uniform(-velocity_rad_s, velocity_rad_s, speed.shape)


def randomise(
    state: State,
    ids: IntArray,
    generators: Generators,
    *,
    field: str,
    low: float,
    high: float,
    rows: Any = slice(None),
    columns: Any = None,
) -> None:
    """Randomise the domain: multiply a field of the model by one factor per episode.

    Args:
        state: the simulations; ids: those that restart; generators: one for each.
        field: of the model, such as ``geom_friction``, ``body_mass``, ``actuator_gainprm``, ``dof_damping``.
        low, high: range of the factor, uniform.
        rows: which entries of the field; columns: which columns of them, None for all.
    """
    values = state.parameter(field)
    nominal = _nominal(state, field)
    key = (rows,) if columns is None else (rows, columns)
    for index, generator in zip(ids, generators, strict=True):
        values[(index, *key)] = nominal[key] * generator.uniform(low, high)


def randomise_servos(state: State, ids: IntArray, generators: Generators, *, low: float, high: float) -> None:
    """Randomise position servos: multiply gain and matching bias by one factor."""
    gain, bias = state.parameter("actuator_gainprm"), state.parameter("actuator_biasprm")
    nominal_gain, nominal_bias = _nominal(state, "actuator_gainprm"), _nominal(state, "actuator_biasprm")
    for index, generator in zip(ids, generators, strict=True):
        factor = generator.uniform(low, high)
        gain[index, :, 0] = nominal_gain[:, 0] * factor
        bias[index, :, 1] = nominal_bias[:, 1] * factor


def _nominal(state: State, field: str) -> Any:
    """Return the value of a field before randomisation."""
    key = f"nominal {field}"
    if key not in state.memory:
        state.memory[key] = np.array(state.parameter(field)[0])
    return state.memory[key]
