"""The position loop of joints whose actuators take a force or a velocity.

It models a servo: it knows the inertia and the weight of the arm, so that a joint without gains of its own
moves to its goal as a critically damped spring, however heavy it is, and holds there against gravity. With
gains of its own, a joint is pulled by the position gain times its error and braked by the velocity gain times
its speed; its weight is carried in this case, too. The limits of the model's actuators apply to the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.coordinates import Coordinates
from joshua_mujoco_sim.drivable import DrivableJoint
from joshua_mujoco_sim.drives import Drives

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

#: Natural frequency of a joint near its goal, by what its actuators take; a velocity drive brakes by itself.
FREQUENCIES_RAD_S = {"position": 30.0, "velocity": 10.0, "torque": 30.0}

#: Largest natural frequency, times the time step, at which the loop is stable.
LARGEST_PHASE_STEP = 0.2

#: Share of a joint's force that is planned for braking before the goal.
BRAKING_SHARE = 0.5

#: Time constant of the estimate of what else acts on the joints.
DISTURBANCE_S = 0.05

#: Simulated time after which inertia and damping are computed again.
REFRESH_S = 0.01


@dataclass(frozen=True)
class Gains:
    """Gains of one joint: position in N·m/rad or N/m, velocity in N·m·s/rad or N·s/m."""

    position: float
    velocity: float


class PositionLoop:
    """Drives joints to goals by forces or velocities.

    Args:
        model: the compiled model; data: its state; joints: that the loop may drive.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[DrivableJoint]) -> None:
        self._model, self._data = model, data
        self._drives = Drives(model, data, joints)
        self._coordinates = Coordinates(model, data, joints)
        count = len(joints)
        largest = LARGEST_PHASE_STEP / float(model.opt.timestep)
        self._frequency = np.array([min(FREQUENCIES_RAD_S[joint.kind], largest) for joint in joints])
        self._takes_positions = np.array([joint.kind == "position" for joint in joints], np.bool_)
        self._goal: FloatArray = np.full(count, np.nan)
        self._gains: FloatArray = np.full((2, count), np.nan)
        self._motion: FloatArray = np.zeros((model.nv, count))
        self._inertia: FloatArray = np.zeros((count, count))
        self._damping: FloatArray = np.zeros(count)
        self._disturbance: FloatArray = np.zeros(model.nv)
        self._refreshed_s = -np.inf

    def set_goals(self, places: IntArray, goals: FloatArray) -> None:
        """Set the goals of some joints, in radians or metres; NaN ends the driving of a joint."""
        self._goal[places] = goals

    def goals(self, places: IntArray) -> FloatArray:
        """Return the goals of some joints; NaN for those that are not driven."""
        return np.asarray(self._goal[places])

    def set_gains(self, place: int, gains: Gains) -> None:
        """Replace the default gains of a joint."""
        self._gains[:, place] = gains.position, gains.velocity

    def clear(self) -> None:
        """Drive no joint any more."""
        self._goal[:] = np.nan
        self._refreshed_s = -np.inf
        self._disturbance[:] = 0.0

    @property
    def active(self) -> bool:
        """Whether a joint is driven."""
        return bool(np.isfinite(self._goal).any())

    def apply(self) -> None:
        """Set the commands of the actuators for the next step."""
        driven = np.isfinite(self._goal)
        if (driven & self._takes_positions).any():
            self._drives.go_to(np.where(self._takes_positions, self._goal, np.nan))
        pushed = driven & ~self._takes_positions
        if pushed.any():
            position = self._coordinates.position()
            self._refresh(position)
            self._estimate_disturbance(pushed)
            force = self._force(position, pushed)
            self._drives.push(np.where(pushed, force, np.nan), position)

    def _force(self, position: FloatArray, pushed: BoolArray) -> FloatArray:
        """Return the force on each joint, N·m or N, without the braking by the actuators themselves."""
        data = self._data
        velocity = self._coordinates.velocity()
        error = np.where(pushed, self._goal - position, 0.0)
        load = data.qfrc_bias - data.qfrc_spring - data.qfrc_gravcomp + self._disturbance
        weight = np.where(pushed, self._motion.T @ load, 0.0)
        wanted = self._wanted_velocity(error, weight, position)
        # a joint that the loop does not drive counts as one at rest
        acceleration = np.where(pushed, 2 * self._frequency * (wanted - velocity), 0.0)
        force = self._inertia @ acceleration + 2 * self._damping * wanted
        position_gain, velocity_gain = self._gains
        force = np.where(np.isfinite(position_gain), position_gain * error - velocity_gain * velocity, force)
        return np.asarray(force + weight)

    def _wanted_velocity(self, error: FloatArray, weight: FloatArray, position: FloatArray) -> FloatArray:
        """Return the velocity towards the goal, from which the joint can still brake."""
        limit = self._drives.force_limit(position)
        spare = np.maximum(limit - np.abs(weight), 0.1 * limit)
        deceleration = BRAKING_SHARE * spare / self._inertia.diagonal()
        fastest = np.sqrt(2 * deceleration * np.abs(error))
        return np.clip(self._frequency / 2 * error, -fastest, fastest)

    def _estimate_disturbance(self, pushed: BoolArray) -> None:
        """Estimate the forces that the joints need because of contacts, friction, and other moving joints.

        It takes them from the last step, smoothed: a push against an obstacle grows to the force limit.
        """
        model, data = self._model, self._data
        moved = (self._motion[:, pushed] != 0.0).any(axis=1)
        needed = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, needed, np.where(moved, 0.0, data.qacc))
        needed -= data.qfrc_constraint
        share = min(1.0, float(model.opt.timestep) / DISTURBANCE_S)
        self._disturbance += share * (needed - self._disturbance)

    def _refresh(self, position: FloatArray) -> None:
        """Compute inertia, damping and friction at the present positions, if they are old."""
        model, data = self._model, self._data
        if 0 <= data.time - self._refreshed_s < REFRESH_S:
            return
        self._refreshed_s = float(data.time)
        motion = self._coordinates.motion()
        product = np.zeros(model.nv)
        for place in range(motion.shape[1]):
            mujoco.mj_mulM(model, data, product, np.ascontiguousarray(motion[:, place]))
            self._inertia[:, place] = motion.T @ product
        np.fill_diagonal(self._inertia, np.maximum(self._inertia.diagonal(), 1e-9))
        self._damping = (motion**2).T @ model.dof_damping + self._drives.damping(position)
        self._motion = motion
