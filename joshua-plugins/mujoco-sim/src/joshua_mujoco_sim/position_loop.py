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

#: Time constant of the estimate of the constraint forces; a shorter one makes legs on the ground swing.
CONSTRAINT_S = 0.5

#: Share of a joint's range over which the compensation of dry friction rises to all of it.
FRICTION_SHARE = 0.002

#: Shortest time in which a joint crosses its range.
CROSSING_S = 0.4

#: Simulated time after which inertia, damping and force limits are computed again.
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
        others: further joints that actuators move.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        joints: Sequence[DrivableJoint],
        others: Sequence[DrivableJoint] = (),
    ) -> None:
        self._model, self._data = model, data
        self._drives = Drives(model, data, joints)
        self._coordinates = Coordinates(model, data, joints)
        count = len(joints)
        largest = LARGEST_PHASE_STEP / float(model.opt.timestep)
        self._frequency = np.array([min(FREQUENCIES_RAD_S[joint.kind], largest) for joint in joints])
        self._takes_positions = np.array([joint.kind == "position" for joint in joints], np.bool_)
        self._goal: FloatArray = np.full(count, np.nan)
        self._gains: FloatArray = np.full((2, count), np.nan)
        self._has_gains = False
        #: Degrees of freedom that no actuator moves, such as those of a floating base.
        self._passive = ~_moved(model, data, (*joints, *others))
        self._reduced: FloatArray = np.zeros((count, model.nv))
        self._inertia: FloatArray = np.zeros((count, count))
        self._damping: FloatArray = np.zeros(count)
        self._limit: FloatArray = np.zeros(count)
        self._friction: FloatArray = np.zeros(count)
        self._has_friction = bool(model.dof_frictionloss.any())
        self._friction_width = np.array([FRICTION_SHARE * (joint.high - joint.low) for joint in joints])
        self._constraint: FloatArray = np.zeros(model.nv)
        #: Degrees of freedom whose gravity compensation counts as a force of their actuators.
        self._compensates_gravity = model.jnt_actgravcomp[model.dof_jntid].astype(bool)
        explicit = model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
        #: Damping that is integrated implicitly acts within a step, as if it added to the inertia.
        self._implicit_s = 0.0 if explicit else float(model.opt.timestep)
        self._fastest = np.array([(joint.high - joint.low) / CROSSING_S for joint in joints])
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
        self._has_gains = True

    def clear(self) -> None:
        """Drive no joint any more."""
        self._goal[:] = np.nan
        self._refreshed_s = -np.inf
        self._constraint[:] = 0.0

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
            force = self._force(position, pushed)
            self._drives.push(np.where(pushed, force, np.nan), position)

    def _force(self, position: FloatArray, pushed: BoolArray) -> FloatArray:
        """Return the force on each joint, N·m or N, without the braking by the actuators themselves."""
        velocity = self._coordinates.velocity()
        error = np.where(pushed, self._goal - position, 0.0)
        weight = np.where(pushed, self._reduced @ self._load(), 0.0)
        wanted = self._wanted_velocity(error, weight)
        # a joint that the loop does not drive counts as one at rest
        acceleration = np.where(pushed, 2 * self._frequency * (wanted - velocity), 0.0)
        force = self._inertia @ acceleration + 2 * self._damping * wanted
        if self._has_gains:
            force = np.where(np.isfinite(self._gains[0]), self._by_gains(error, velocity), force)
        return np.asarray(force + weight + self._against_friction(error))

    def _by_gains(self, error: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return the forces by the gains of the file, any value without gains.

        The error and the speed are those at the end of the step, so that no gain is too large for the time
        step: J. Tan, K. Liu, G. Turk, Stable Proportional-Derivative Controllers, 2011.
        """
        timestep_s = float(self._model.opt.timestep)
        position_gain, velocity_gain = np.nan_to_num(self._gains)
        force = position_gain * (error - timestep_s * velocity) - velocity_gain * velocity
        added = timestep_s * velocity_gain + timestep_s**2 * position_gain
        acceleration = np.linalg.solve(self._inertia + np.diag(added), force)
        return np.asarray(force - added * acceleration)

    def _wanted_velocity(self, error: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the velocity towards the goal, from which the joint can still brake."""
        spare = np.maximum(self._limit - np.abs(weight), 0.1 * self._limit)
        deceleration = BRAKING_SHARE * spare / self._inertia.diagonal()
        fastest = np.minimum(np.sqrt(2 * deceleration * np.abs(error)), self._fastest)
        return np.asarray(np.minimum(np.maximum(self._frequency / 2 * error, -fastest), fastest))

    def _against_friction(self, error: FloatArray) -> FloatArray:
        """Return the force that overcomes dry friction, less of it near the goal."""
        stable = self._friction / self._inertia.diagonal() * (self._model.opt.timestep / 0.3) ** 2
        width = np.maximum(self._friction_width, stable)
        return np.asarray(self._friction * np.clip(error / width, -1.0, 1.0))

    def _load(self) -> FloatArray:
        """Return the force on each degree of freedom that keeps it from accelerating, shape (nv,).

        Contacts and coupled joints count as in the last steps, smoothed: a push against an obstacle grows to
        the force limit. The dry friction of joints does not count.
        """
        data = self._data
        share = min(1.0, float(self._model.opt.timestep) / CONSTRAINT_S)
        constraint = data.qfrc_constraint
        if self._has_friction:
            constraint = constraint - _dry_friction(self._model, data)
        self._constraint += share * (constraint - self._constraint)
        compensated = np.where(self._compensates_gravity, data.qfrc_gravcomp, 0.0)
        return np.asarray(data.qfrc_bias - data.qfrc_passive - compensated - self._constraint)

    def _refresh(self, position: FloatArray) -> None:
        """Compute what changes slowly at the present positions, if it is old."""
        model, data = self._model, self._data
        if 0 <= data.time - self._refreshed_s < REFRESH_S:
            return
        self._refreshed_s = float(data.time)
        motion = self._coordinates.motion()
        mass = np.zeros((model.nv, model.nv))
        for dof, column in enumerate(np.eye(model.nv)):
            mujoco.mj_mulM(model, data, mass[dof], column)
        mass += np.diag(self._implicit_s * model.dof_damping)
        reduced = motion.T.copy()
        passive = np.flatnonzero(self._passive)
        if passive.size:
            own = mass[np.ix_(passive, passive)]
            shared = motion.T @ mass[:, passive]
            reduced[:, passive] -= np.linalg.solve(own, shared.T).T
        self._reduced = reduced
        self._inertia = reduced @ mass @ motion
        np.fill_diagonal(self._inertia, np.maximum(self._inertia.diagonal(), 1e-9))
        self._damping = self._drives.damping(position)
        self._limit = self._drives.force_limit(position)
        self._friction = np.abs(motion).T @ model.dof_frictionloss


def _moved(model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[DrivableJoint]) -> BoolArray:
    """Return which degrees of freedom move with some joints, shape (nv,)."""
    motion = Coordinates(model, data, joints).motion()
    return np.asarray((motion != 0).any(axis=1))


def _dry_friction(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """Return the forces of dry friction in the last step, shape (nv,)."""
    rows = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF))
    forces = np.zeros(model.nv)
    forces[data.efc_id[rows]] = data.efc_force[rows]
    return forces
