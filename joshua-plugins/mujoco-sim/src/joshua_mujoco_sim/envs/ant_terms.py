"""Terms of the ant, equal to those of Gymnasium's ``Ant-v5``."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from joshua_mujoco_sim.envs.starts import Draws, Start
from joshua_mujoco_sim.envs.state import State

HEALTHY_M = (0.2, 1.0)


def motors(state: State) -> Any:
    """Apply the action as the torque of each motor, -1 to 1."""
    return state.action


def posture(state: State) -> Any:
    """Return height, attitude and joints, without the position on the floor."""
    return state.qpos[:, 2:]


def contact_forces(state: State) -> Any:
    """Return the contact forces on each body except the world, clipped to ±1, shape (N, 6 · bodies)."""
    return state.xp.clip(state.contact_forces[:, 1:], -1.0, 1.0).reshape(state.count, -1)


def contact_size(state: State) -> Any:
    """Return the sum of the squared contact forces, each clipped to ±1."""
    forces = state.xp.clip(state.contact_forces, -1.0, 1.0)
    return (forces * forces).sum(axis=(1, 2))


def torso(state: State) -> Any:
    """Position and attitude of the torso, shape (N, 7)."""
    return state.qpos[:, :7]


def travelled(state: State, *, step_s: float) -> Any:
    """Return the torso's x divided by the step duration; its change per step is the speed in m/s."""
    return state.body("torso")[:, 0] / step_s


def unhealthy(state: State) -> Any:
    """Return whether the torso is too low or too high, or the state is not finite."""
    height = state.qpos[:, 2]
    finite = state.xp.isfinite(state.qpos.sum(axis=1) + state.qvel.sum(axis=1))
    return ~(finite & (height >= HEALTHY_M[0]) & (height <= HEALTHY_M[1]))


def healthy(state: State) -> Any:
    """1 while the ant is healthy."""
    return 1.0 - unhealthy(state)


def start(start: Start, draws: Draws, *, scale: float) -> Start:
    """Start with noise: uniform positions, normal speeds."""
    qpos = start.qpos + draws.uniform(-scale, scale, start.qpos.shape[1:])
    return replace(start, qpos=qpos, qvel=start.qvel + scale * draws.normal(start.qvel.shape[1:]))
