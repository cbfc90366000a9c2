"""A hand that holds joints of the model and moves them along paths, in place of a person's.

Forces come from the model's own inertia and weight, so that the hand is as strong as the arm needs, and the
stops of the joints are those of the physics.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from joshua_calibration.hand import Path

from joshua_mujoco_sim.physics import ActuatorGroup, FloatArray, Physics

#: How firmly a joint is brought onto its path; critically damped.
STIFFNESS_PER_S2 = 10_000.0
DAMPING_PER_S = 200.0

#: How far the hand continues from one look at the joints to the next: less than it rests at an end of a
#: range.
LOOK_S = 0.02

#: Largest acceleration, which bounds the force at a stop or an obstacle.
ACCELERATION_RAD_S2 = 5_000.0


class Hand:
    """Moves all joints of a group; those without a path are held where they were.

    Whoever calibrates must see every part of the way: the hand continues only as fast as somebody looks.

    Args:
        physics: the model; group: the joints.
    """

    def __init__(self, physics: Physics, group: ActuatorGroup) -> None:
        self._group = group
        self._dofs = group.degrees_of_freedom
        self._paths: Mapping[int, Path] = {}
        self._elapsed_s = 0.0
        self._left_s = 0.0
        self._still: FloatArray | None = None
        self._acceleration: FloatArray = np.zeros(physics.model.nv)
        self._force: FloatArray = np.zeros(physics.model.nv)

    def follow(self, paths: Mapping[int, Path]) -> None:
        """Take hold of all joints, and move some: paths in radians of the model from now on."""
        self._still = self._group.position_rad
        self._paths, self._elapsed_s, self._left_s = paths, 0.0, LOOK_S

    def looked_at(self) -> None:
        """Say that somebody has seen where the joints are."""
        self._left_s = LOOK_S

    def let_go(self, physics: Physics) -> None:
        """Let all joints go."""
        self._still, self._paths = None, {}
        physics.data.qfrc_applied[self._dofs] = 0.0

    def push(self, physics: Physics) -> None:
        """Apply the forces, before each step and under the lock."""
        if self._still is None:
            return
        data, elapsed_s, step_s = physics.data, self._elapsed_s, physics.timestep_s
        if self._left_s > 0.0:
            self._elapsed_s += step_s
            self._left_s -= step_s
        wanted, next_wanted = self._still.copy(), self._still.copy()
        for index, path in self._paths.items():
            wanted[index], next_wanted[index] = path(elapsed_s), path(self._elapsed_s)
        group = self._group
        speed = (next_wanted - wanted) / step_s
        pull = STIFFNESS_PER_S2 * (wanted - group.position_rad)
        pull += DAMPING_PER_S * (speed - group.velocity_rad_s)
        self._acceleration[self._dofs] = np.clip(pull, -ACCELERATION_RAD_S2, ACCELERATION_RAD_S2)
        mujoco.mj_mulM(physics.model, data, self._force, self._acceleration)
        weight = data.qfrc_bias - data.qfrc_passive
        data.qfrc_applied[self._dofs] = (self._force + weight)[self._dofs]
