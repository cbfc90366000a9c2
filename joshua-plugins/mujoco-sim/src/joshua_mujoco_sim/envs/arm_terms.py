"""Terms of the SO-ARM100: reaching, picking and placing."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from joshua_mujoco_sim.envs.state import Columns, FloatArray, IntArray, State, square_sum
from joshua_mujoco_sim.envs.terms import Generators

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")

#: Largest change of a goal in one step: 2.5 rad/s at 25 Hz.
STEP_RAD = 0.1

#: How far a goal may be ahead of its joint, so that a blocked joint does not wind up.
LEAD_RAD = 0.4

HALF_CUBE_M = 0.0125

#: Distance of grip and cube from which on the jaw has let go.
LET_GO_M = 0.03


def move_goals(state: State) -> None:
    """The action moves the servos' goals, at most ``STEP_RAD`` a step, inside the joints' ranges."""
    arm, limits = state.qpos[:, :6], _limits(state)
    goal = state.ctrl + STEP_RAD * state.action
    np.minimum(goal, arm + LEAD_RAD, out=goal)
    np.maximum(goal, arm - LEAD_RAD, out=goal)
    np.minimum(goal, limits[1], out=goal)
    np.maximum(goal, limits[0], out=state.ctrl)


def _limits(state: State) -> FloatArray:
    """Lowest and highest goals, shape (2, A)."""
    found = state.memory.get("goal limits")
    if found is None:
        found = state.memory["goal limits"] = np.ascontiguousarray(state.model.actuator_ctrlrange.T)
    return found


def distance(state: State, *, first: str, second: str) -> FloatArray:
    """Distance between two sites, m, shape (N,)."""
    key = (first, second)
    found = state.step_cache.get(key)
    if found is None:
        way = state.site(first) - state.site(second)
        found = state.step_cache[key] = np.sqrt(square_sum(way))
    return found


def offset(state: State, *, first: str, second: str) -> FloatArray:
    """From one site to another, m, shape (N, 3)."""
    return state.site(second) - state.site(first)


def closeness(state: State, *, first: str, second: str, scale_m: float) -> FloatArray:
    """1 where two sites meet, falling with the distance as 1 − tanh(d / scale)."""
    return 1 - np.tanh(distance(state, first=first, second=second) / scale_m)


def within(state: State, *, first: str, second: str, radius_m: float) -> Any:
    """Two sites are nearer than a radius."""
    return distance(state, first=first, second=second) < radius_m


def within_reward(state: State, *, first: str, second: str, radius_m: float) -> FloatArray:
    """1 where two sites are nearer than a radius, as a reward."""
    near: FloatArray = within(state, first=first, second=second, radius_m=radius_m).astype(np.float64)
    return near


def lifted(state: State, *, height_m: float) -> FloatArray:
    """How far the cube is off the table, from 0 to 1 at ``height_m``."""
    height: FloatArray = (state.site("cube")[:, 2] - HALF_CUBE_M) / height_m
    return np.minimum(np.maximum(height, 0.0, out=height), 1.0, out=height)


def carried_closeness(state: State, *, height_m: float, scale_m: float) -> FloatArray:
    """Closeness of the cube to the goal while it is lifted."""
    return lifted(state, height_m=height_m) * closeness(state, first="cube", second="goal", scale_m=scale_m)


def placed(state: State, *, radius_m: float) -> Any:
    """The cube rests on the goal, and the grip has let go of it."""
    found = state.step_cache.get("placed")
    if found is None:
        cube = state.site("cube")
        way = cube - state.site("goal")
        beside = square_sum(way[:, :2]) < radius_m**2
        down = np.abs(cube[:, 2] - HALF_CUBE_M) < 0.004
        away = distance(state, first="gripper", second="cube") > LET_GO_M
        found = state.step_cache["placed"] = beside & down & away
    return found


def placed_reward(state: State, *, radius_m: float) -> FloatArray:
    """1 where the cube is placed, as a reward."""
    result: FloatArray = placed(state, radius_m=radius_m).astype(np.float64)
    return result


def dropped(state: State) -> Any:
    """The cube has fallen off the table."""
    return state.site("cube")[:, 2] < -0.05


def place_goal(
    state: State,
    ids: IntArray,
    generators: Generators,
    *,
    radius_m: tuple[float, float],
    angle_rad: float,
    height_m: tuple[float, float],
) -> None:
    """Puts the goal somewhere in front of the arm: a sector of a ring, at some height."""
    for index, generator in zip(ids, generators, strict=True):
        state.mocap_pos[index, 0] = _in_sector(generator, radius_m, angle_rad, height_m)


def place_cube(
    state: State,
    ids: IntArray,
    generators: Generators,
    *,
    radius_m: tuple[float, float],
    angle_rad: float,
    apart_m: float,
) -> None:
    """Puts the cube on the table in front of the arm, turned anyhow, and not on the goal."""
    start = int(state.model.joint("cube").qposadr[0])
    for index, generator in zip(ids, generators, strict=True):
        for _ in range(100):
            position = _in_sector(generator, radius_m, angle_rad, (HALF_CUBE_M, HALF_CUBE_M))
            if np.hypot(*(position - state.mocap_pos[index, 0])[:2]) >= apart_m:
                break
        half_turn = generator.uniform(-np.pi, np.pi) / 2
        state.qpos[index, start : start + 3] = position
        state.qpos[index, start + 3 : start + 7] = (np.cos(half_turn), 0, 0, np.sin(half_turn))


def arm_columns(model: mujoco.MjModel) -> Columns:
    """Where the joints of the arm stand in the state."""
    return Columns(model, JOINTS)


def _in_sector(
    generator: np.random.Generator,
    radius_m: tuple[float, float],
    angle_rad: float,
    height_m: tuple[float, float],
) -> FloatArray:
    radius = np.sqrt(generator.uniform(radius_m[0] ** 2, radius_m[1] ** 2))
    angle = generator.uniform(-angle_rad, angle_rad)
    return np.array([radius * np.sin(angle), -0.045 - radius * np.cos(angle), generator.uniform(*height_m)])
