"""A simulated hand that holds joints of the model and moves them along paths.

Forces are scaled by the model's inertia and weight, so the hand is as strong as the arm requires; the joint
stops are those of the physics.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from joshua_calibration.hand import Path

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.physics import FloatArray, Physics

#: Stiffness of the path tracking; critically damped.
STIFFNESS_PER_S2 = 10_000.0
DAMPING_PER_S = 200.0

#: Longest motion between two readings of the joints; shorter than the rest at the ends of a range.
LOOK_S = 0.02

#: Largest acceleration, which bounds the force at a stop or an obstacle.
ACCELERATION_RAD_S2 = 5_000.0


class Hand:
    """Moves all joints of a group; joints without a path are held in place.

    A calibration must see the whole motion, so the hand advances only as fast as the joints are read.

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
        """Hold all joints and move some along paths in radians of the model, starting now."""
        self._still = self._group.position_rad
        self._paths, self._elapsed_s, self._left_s = paths, 0.0, LOOK_S

    def looked_at(self) -> None:
        """Report that the joints were read."""
        self._left_s = LOOK_S

    def let_go(self, physics: Physics) -> None:
        """Release all joints."""
        self._still, self._paths = None, {}
        physics.data.qfrc_applied[self._dofs] = 0.0

    def push(self, physics: Physics) -> None:
        """Apply the forces (before each step, under the lock)."""
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
