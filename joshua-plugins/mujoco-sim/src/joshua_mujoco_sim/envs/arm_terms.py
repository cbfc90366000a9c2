"""Terms of the SO-ARM100: reaching, picking and placing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from joshua_mujoco_sim.envs.starts import Draws, Start, with_values
from joshua_mujoco_sim.envs.state import Columns, FloatArray, State, square_sum

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")

#: Largest change of a goal in one step: 2.5 rad/s at 25 Hz.
STEP_RAD = 0.1

#: Largest lead of a goal over its joint, so a blocked joint does not wind up.
LEAD_RAD = 0.4

HALF_CUBE_M = 0.0125

#: Distances of grip and cube from their goals at which the task succeeds.
REACHED_M, PLACED_M = 0.01, 0.02

#: Distance between grip and cube from which the cube counts as released.
LET_GO_M = 0.03

#: Speed of the cube below which it counts as at rest, m/s.
REST_M_S = 0.02


def move_goals(state: State) -> Any:
    """Apply the action as a change of the goals, at most ``STEP_RAD`` per step, within joint ranges."""
    xp, arm = state.xp, state.qpos[:, :6]
    low, high = goal_ranges(state.model)
    goal = xp.clip(state.ctrl + STEP_RAD * state.action, arm - LEAD_RAD, arm + LEAD_RAD)
    return xp.clip(goal, low, high)


def take_goals(state: State) -> Any:
    """Apply the action as goals in rad, as in data sets, within joint ranges."""
    low, high = goal_ranges(state.model)
    return state.xp.clip(state.action, low, high)


def goal_ranges(model: mujoco.MjModel) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest goals, rad."""
    return model.actuator_ctrlrange[:, 0], model.actuator_ctrlrange[:, 1]


def lowest_goals(model: mujoco.MjModel) -> FloatArray:
    """Lowest goals, rad."""
    return goal_ranges(model)[0]


def highest_goals(model: mujoco.MjModel) -> FloatArray:
    """Highest goals, rad."""
    return goal_ranges(model)[1]


def present_goals(state: State) -> Any:
    """Return the present goals, rad, shape (N, 6)."""
    return state.ctrl


def workspace(model: mujoco.MjModel) -> FloatArray:
    """Return a point in the middle of the workspace, m."""
    del model
    return np.array([0.0, -0.25, 0.12])


def middles(model: mujoco.MjModel) -> FloatArray:
    """The middle of each joint's range, rad."""
    return np.asarray(model.jnt_range[:6].mean(axis=1))


def half_ranges(model: mujoco.MjModel) -> FloatArray:
    """Half of each joint's range, rad."""
    return np.asarray((model.jnt_range[:6, 1] - model.jnt_range[:6, 0]) / 2)


def distance(state: State, *, first: str, second: str) -> Any:
    """Distance between two sites, m, shape (N,)."""
    key = (first, second)
    found = state.step_cache.get(key)
    if found is None:
        way = state.site(first) - state.site(second)
        found = state.step_cache[key] = state.xp.sqrt(square_sum(way))
    return found


def offset(state: State, *, first: str, second: str) -> Any:
    """From one site to another, m, shape (N, 3)."""
    return state.site(second) - state.site(first)


def closeness(state: State, *, first: str, second: str, scale_m: float) -> Any:
    """Return 1 − tanh(d / scale) of the distance between two sites."""
    return 1.0 - state.xp.tanh(distance(state, first=first, second=second) / scale_m)


def within(state: State, *, first: str, second: str, radius_m: float) -> Any:
    """Return whether two sites are closer than a radius."""
    return distance(state, first=first, second=second) < radius_m


def within_reward(state: State, *, first: str, second: str, radius_m: float) -> Any:
    """Return 1 if two sites are closer than a radius, as a reward."""
    return 1.0 * within(state, first=first, second=second, radius_m=radius_m)


def cube_pose(state: State) -> Any:
    """Position (m) and attitude (w, x, y, z) of the cube, shape (N, 7)."""
    return state.qpos[:, 6:13]


def goal_position(state: State) -> Any:
    """Where the goal is, m, shape (N, 3)."""
    return state.mocap_pos[:, 0]


def lifted(state: State, *, height_m: float) -> Any:
    """Return the height of the cube above the table, 1 at ``height_m``; always 1 above the goal."""
    xp = state.xp
    height = xp.clip((state.site("cube")[:, 2] - HALF_CUBE_M) / height_m, 0.0, 1.0)
    return xp.where(_beside(state, PLACED_M), 1.0, height)


def placed(state: State, *, radius_m: float) -> Any:
    """Return whether the cube rests on the goal and is released."""
    slow = square_sum(state.qvel[:, 6:9]) < REST_M_S**2
    down = state.xp.abs(state.site("cube")[:, 2] - HALF_CUBE_M) < 0.004
    away = distance(state, first="gripper", second="cube") > LET_GO_M
    return _beside(state, radius_m) & down & slow & away


def placed_reward(state: State, *, radius_m: float) -> Any:
    """Return 1 if the cube is placed, as a reward."""
    return 1.0 * placed(state, radius_m=radius_m)


def dropped(state: State) -> Any:
    """Return whether the cube has fallen off the table."""
    return state.site("cube")[:, 2] < -0.05


def dropped_reward(state: State) -> Any:
    """Return 1 if the cube has fallen off the table, for a reward with negative weight."""
    return 1.0 * dropped(state)


def _beside(state: State, radius_m: float) -> Any:
    """Return whether the cube is above or on the goal."""
    way = offset(state, first="cube", second="goal")
    return square_sum(way[:, :2]) < radius_m**2


def place_goal(
    start: Start,
    draws: Draws,
    *,
    radius_m: tuple[float, float],
    angle_rad: float,
    height_m: tuple[float, float],
) -> Start:
    """Place the goal at random in front of the arm: a sector of a ring, at some height."""
    place = _in_sector(start.xp, draws, radius_m, angle_rad, height_m)
    return replace(start, mocap_pos=with_values(start.mocap_pos, (slice(None), 0), place))


def place_cube(
    start: Start,
    draws: Draws,
    *,
    radius_m: tuple[float, float],
    angle_rad: float,
    apart_m: float,
) -> Start:
    """Place the cube at random on the table in front of the arm, in any orientation, not on the goal."""
    xp, goal = start.xp, start.mocap_pos[:, 0]

    def propose(draws: Draws) -> Any:
        return _in_sector(xp, draws, radius_m, angle_rad, (HALF_CUBE_M, HALF_CUBE_M))

    def is_apart(places: Any) -> Any:
        return xp.hypot(places[:, 0] - goal[:, 0], places[:, 1] - goal[:, 1]) >= apart_m

    place = draws.until(propose, is_apart, 100)
    half_turn = draws.uniform(-np.pi, np.pi) / 2
    zero = xp.zeros_like(half_turn)
    attitude = xp.stack([xp.cos(half_turn), zero, zero, xp.sin(half_turn)], axis=1)
    first = int(start.model.joint("cube").qposadr[0])
    pose = xp.concatenate([place, attitude], axis=1)
    return replace(start, qpos=with_values(start.qpos, (slice(None), slice(first, first + 7)), pose))


def arm_columns(model: mujoco.MjModel) -> Columns:
    """Return the indices of the arm's joints in the state."""
    return Columns(model, JOINTS)


def _in_sector(
    xp: Any, draws: Draws, radius_m: tuple[float, float], angle_rad: float, height_m: tuple[float, float]
) -> Any:
    """Draw places in front of the arm, shape (n, 3)."""
    radius = xp.sqrt(draws.uniform(radius_m[0] ** 2, radius_m[1] ** 2))
    angle = draws.uniform(-angle_rad, angle_rad)
    height = draws.uniform(*height_m)
    return xp.stack([radius * xp.sin(angle), -0.045 - radius * xp.cos(angle), height], axis=1)
