"""Terms that fit any robot."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco

from joshua_mujoco_sim.envs.starts import Draws, Start, with_values
from joshua_mujoco_sim.envs.state import State, square_sum


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


def diverged(state: State) -> Any:
    """Return whether a position or speed is beyond the limit of MuJoCo's own check, or not a number."""
    size, limit = state.xp.abs, mujoco.mjMAXVAL
    # NaN is not below the limit
    return ~((size(state.qpos) < limit).all(axis=1) & (size(state.qvel) < limit).all(axis=1))


def noisy_joints(
    start: Start,
    draws: Draws,
    *,
    qpos: Any = slice(None),
    qvel: Any = slice(None),
    position_rad: float = 0.0,
    velocity_rad_s: float = 0.0,
) -> Start:
    """Start with uniform noise on the joints of the keyframe."""
    place, speed = start.qpos[:, qpos], start.qvel[:, qvel]
    place = place + draws.uniform(-position_rad, position_rad, place.shape[1:])
    speed = speed + draws.uniform(-velocity_rad_s, velocity_rad_s, speed.shape[1:])
    return replace(
        start,
        qpos=with_values(start.qpos, (slice(None), qpos), place),
        qvel=with_values(start.qvel, (slice(None), qvel), speed),
    )


def randomise(
    start: Start,
    draws: Draws,
    *,
    field: str,
    low: float,
    high: float,
    rows: Any = slice(None),
    columns: Any = None,
) -> Start:
    """Randomise the domain: multiply a field of the model by one factor per episode.

    Args:
        start: the simulations that restart; draws: their random numbers.
        field: of the model, such as ``geom_friction``, ``body_mass``, ``actuator_gainprm``, ``dof_damping``.
        low, high: range of the factor, uniform.
        rows: which entries of the field; columns: which columns of them, None for all.
    """
    key = (rows,) if columns is None else (rows, columns)
    nominal = start.nominal(field)[key]
    factor = draws.uniform(low, high).reshape(-1, *(1 for _ in nominal.shape))
    values = with_values(start.parameter(field), (slice(None), *key), nominal * factor)
    return start.with_parameter(field, values)


def randomise_servos(start: Start, draws: Draws, *, low: float, high: float) -> Start:
    """Randomise position servos: multiply gain and matching bias by one factor."""
    factor = draws.uniform(low, high)[:, None]
    for field, column in (("actuator_gainprm", 0), ("actuator_biasprm", 1)):
        values = start.nominal(field)[:, column] * factor
        key = (slice(None), slice(None), column)
        start = start.with_parameter(field, with_values(start.parameter(field), key, values))
    return start
