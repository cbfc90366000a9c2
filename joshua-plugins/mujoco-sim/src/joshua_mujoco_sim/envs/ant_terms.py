"""Terms of the ant, by the published figures of the benchmark (healthy 1, forward 1, control 0.5)."""

from __future__ import annotations

from typing import Any

import numpy as np

from joshua_mujoco_sim.envs.state import FloatArray, IntArray, State
from joshua_mujoco_sim.envs.terms import Generators

HEALTHY_M = (0.2, 1.0)


def motors(state: State) -> None:
    """The action is the torque of each motor, from -1 to 1."""
    state.ctrl[:] = state.action


def posture(state: State) -> FloatArray:
    """Height, attitude and joints; not where it is on the floor."""
    return state.qpos[:, 2:]


def prepare(state: State) -> None:
    """Keeps where the torso was before the step."""
    state.memory["x_m"] = np.zeros(state.count)


def forward_speed(state: State, *, step_s: float) -> FloatArray:
    """Mean speed of the torso along x in this step, m/s."""
    x = state.qpos[:, 0]
    speed: FloatArray = (x - state.memory["x_m"]) / step_s
    state.memory["x_m"][:] = x
    return speed


def unhealthy(state: State) -> Any:
    """The torso is too low or too high, or the state is not finite."""
    height = state.qpos[:, 2]
    finite = np.isfinite(np.add.reduce(state.qvel, axis=1))
    return ~(finite & (height >= HEALTHY_M[0]) & (height <= HEALTHY_M[1]))


def healthy(state: State) -> FloatArray:
    """1 while the ant is healthy."""
    result: FloatArray = 1.0 - unhealthy(state)
    return result


def start(state: State, ids: IntArray, generators: Generators, *, scale: float) -> None:
    """Starts with noise: positions uniform, speeds normal."""
    for index, generator in zip(ids, generators, strict=True):
        state.qpos[index] += generator.uniform(-scale, scale, state.qpos.shape[1])
        state.qvel[index] += scale * generator.standard_normal(state.qvel.shape[1])
        state.memory["x_m"][index] = state.qpos[index, 0]
