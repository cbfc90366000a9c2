"""The actuators of some joints: commands for positions and forces, limits, and the forces that they apply."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial

from joshua_mujoco_sim.actuator_kinds import activation_of, control_of, output_of

if TYPE_CHECKING:
    from joshua_mujoco_sim.drivable import DrivableJoint

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

#: Stands for the force of an actuator without a limit, N or N·m.
UNLIMITED_FORCE = 1e9

_NONE, _INTEGRATOR = int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_INTEGRATOR)


class Drives:
    """The actuators that drive some joints, as arrays of shape (D,).

    The force of an actuator is the sum of ``(gain + gain_per_length · length) · input``, ``bias``,
    ``bias_per_length · length`` and ``bias_per_speed · speed``. The input is its control, or what its
    dynamics make of it.

    Args:
        model: the compiled model; data: its state; joints: whose actuators these are.

    Attributes:
        owner: place of the joint of each actuator; actuator: its index in the model.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[DrivableJoint]) -> None:
        self._model, self._data = model, data
        self._count = len(joints)
        pairs = [(place, drive) for place, joint in enumerate(joints) for drive in joint.drives]
        actuators = [drive.actuator for _, drive in pairs]
        self.owner: IntArray = np.array([place for place, _ in pairs], np.int64)
        self.actuator: IntArray = np.array(actuators, np.int64)
        self._control = _indices(control_of(model, actuator) for actuator in actuators)
        self._output = _indices(output_of(model, actuator) for actuator in actuators)
        self._activation = _indices(activation_of(model, actuator) for actuator in actuators)
        self._held = _indices(control_of(model, held) for joint in joints for held in joint.held)
        self._lengths = [Polynomial(drive.length) for _, drive in pairs]
        self._slopes = [length.deriv() for length in self._lengths]
        affine = model.actuator_biastype[self.actuator] == mujoco.mjtBias.mjBIAS_AFFINE
        self._bias = np.where(affine[:, None], model.actuator_biasprm[self.actuator, :3], 0.0).T
        varies = model.actuator_gaintype[self.actuator] == mujoco.mjtGain.mjGAIN_AFFINE
        gains = model.actuator_gainprm[self.actuator, :3].copy()
        gains[~varies, 1:] = 0.0
        self._gain = gains.T
        self._dynamics: IntArray = model.actuator_dyntype[self.actuator].astype(np.int64)
        #: Part of the way from activation to control, or of the control, that one step goes.
        self._rate: FloatArray = np.array([_rate(model, actuator) for actuator in actuators], np.float64)
        self._share = 1.0 / np.bincount(self.owner, minlength=self._count)[self.owner]
        #: Offset and factor of each length; None if one of them is curved.
        self._straight: tuple[FloatArray, FloatArray] | None = None
        if all(len(length.coef) <= 2 for length in self._lengths):
            ends = np.array([(*length.coef, 0.0)[:2] for length in self._lengths], np.float64)
            self._straight = (ends.reshape(-1, 2)[:, 0], ends.reshape(-1, 2)[:, 1])

    def slope(self, position: FloatArray) -> FloatArray:
        """Return the derivatives of the actuators' lengths by the positions of their joints."""
        if self._straight is not None:
            return self._straight[1]
        at = position[self.owner]
        return np.array([slope(value) for slope, value in zip(self._slopes, at, strict=True)])

    def go_to(self, goals: FloatArray) -> None:
        """Command position drives to the goals of their joints, shape (N,); NaN leaves one as it is."""
        goal = goals[self.owner]
        known = np.isfinite(goal)
        length = self._length(np.where(known, goal, 0.0))
        balance = -(self._bias[0] + self._bias[1] * length) / (self._gain[0] + self._gain[1] * length)
        self._set(balance, known, self._dynamics == _INTEGRATOR)

    def goals(self) -> FloatArray:
        """Return the positions at which position drives balance, shape (N,); NaN where that is not known."""
        goals = np.full(self._count, np.nan)
        if self._straight is None:
            return goals
        given = self._input()
        pull = self._gain[1] * given + self._bias[1]
        balances = pull != 0
        length = -(self._gain[0] * given + self._bias[0]) / np.where(balances, pull, np.nan)
        offset, factor = self._straight
        goals[self.owner[::-1]] = ((length - offset) / factor)[::-1]  # the first drive of a joint counts
        return goals

    def push(self, forces: FloatArray, position: FloatArray) -> None:
        """Command force and velocity drives to forces on their joints, N·m or N, shape (N,); NaN for none.

        The damping of velocity drives is not compensated, so they brake the joint in addition.
        """
        known = np.isfinite(forces)[self.owner]
        force = np.where(known, forces[self.owner], 0.0) * self._share / self.slope(position)
        length = self._length(position[self.owner])
        gain = self._gain[0] + self._gain[1] * length
        self._set((force - self._bias[0] - self._bias[1] * length) / gain, known, self._dynamics != _NONE)

    def let_go(self, position: FloatArray, velocity: FloatArray) -> None:
        """Command all drives to apply no force in the next step."""
        length = self._length(position[self.owner])
        speed = self.slope(position) * velocity[self.owner]
        force = self._bias[0] + self._bias[1] * length + self._bias[2] * speed
        gain = self._gain[0] + self._gain[1] * length
        self._set(-force / gain, np.ones(len(self.owner), np.bool_), self._dynamics != _NONE)

    def rest(self, joints: BoolArray) -> None:
        """Set the controls of some joints, a mask of shape (N,), to zero: no force, or no speed."""
        none = np.zeros(len(self.owner), np.bool_)
        self._set(np.zeros(len(self.owner)), joints[self.owner], none)

    def force(self, position: FloatArray) -> FloatArray:
        """Return the forces that the actuators apply to their joints, N·m or N, shape (N,)."""
        applied = self._data.actuator_force[self._output] * self.slope(position)
        return self._by_joint(applied)

    def damping(self, position: FloatArray) -> FloatArray:
        """Return the damping that the actuators add to their joints, N·m·s/rad or N·s/m, shape (N,)."""
        damping = -self._bias[2]
        added = getattr(self._model, "actuator_damping", None)  # since MuJoCo 4
        if added is not None:
            damping = damping + np.asarray(added)[self.actuator]
        return self._by_joint(damping * self.slope(position) ** 2)

    def stiffness(self, position: FloatArray) -> FloatArray:
        """Return the stiffness of position drives at their joints, N·m/rad or N/m, shape (N,)."""
        return self._by_joint(-self._bias[1] * self.slope(position) ** 2)

    def force_limit(self, position: FloatArray) -> FloatArray:
        """Return the largest forces on the joints, N·m or N, shape (N,); ``UNLIMITED_FORCE`` for none."""
        model = self._model
        limited = model.actuator_forcelimited[self.actuator].astype(bool)
        largest = np.abs(model.actuator_forcerange[self.actuator]).max(axis=1, initial=0.0)
        by_force = np.where(limited, largest, UNLIMITED_FORCE)
        bounded = model.actuator_ctrllimited[self._control].astype(bool)
        control = np.abs(model.actuator_ctrlrange[self._control]).max(axis=1, initial=0.0)
        by_control = np.where(bounded & (self._bias[1] == 0), np.abs(self._gain[0]) * control, np.inf)
        limit = np.minimum(by_force, by_control) * np.abs(self.slope(position))
        return np.minimum(self._by_joint(limit), UNLIMITED_FORCE)

    def scale(self, position: FloatArray, forces: FloatArray) -> FloatArray:
        """Return the sums of forces of the model's actuators on their joints, shape (N,).

        Args:
            position: of the joints; forces: of all actuators of the model, each without a sign.
        """
        return self._by_joint(forces[self.actuator] * np.abs(self.slope(position)))

    def set_force_limit(self, limits: FloatArray, position: FloatArray) -> None:
        """Replace the force limits of the model by limits on the joints, N·m or N, shape (N,)."""
        limit = limits[self.owner] * self._share / np.abs(self.slope(position))
        self._model.actuator_forcerange[self.actuator] = np.column_stack([-limit, limit])

    def _by_joint(self, values: FloatArray) -> FloatArray:
        """Return the sums of the actuators' values for each joint, shape (N,)."""
        return np.asarray(np.bincount(self.owner, values, minlength=self._count), np.float64)

    def _length(self, position: FloatArray) -> FloatArray:
        """Return the lengths of the actuators by the positions of their joints, both of shape (D,)."""
        if self._straight is not None:
            offset, factor = self._straight
            return np.asarray(offset + factor * position)
        return np.array([length(value) for length, value in zip(self._lengths, position, strict=True)])

    def _input(self) -> FloatArray:
        """Return what multiplies the gains: for an integrator its activation, else the control."""
        control = np.array(self._data.ctrl[self._control])
        integrates = self._dynamics == _INTEGRATOR
        if integrates.any():
            control[integrates] = self._data.act[self._activation[integrates]]
        return control

    def _set(self, values: FloatArray, chosen: BoolArray, through: BoolArray) -> None:
        """Set the inputs of some actuators.

        Args:
            values: of the inputs, shape (D,); chosen: actuators that are set; through: those whose activation
                shall have the value after the next step, within the limits of the control.
        """
        data, controls = self._data, self._control
        if through.any():
            values = np.where(through, self._through_dynamics(values), values)
        data.ctrl[controls] = np.where(chosen, values, data.ctrl[controls])
        if self._held.size:
            data.ctrl[self._held] = 0.0

    def _through_dynamics(self, values: FloatArray) -> FloatArray:
        """Return the controls that bring the activations to these values in one step."""
        present = self._data.act[self._activation]  # of an actuator without one: any value, not used
        kept = np.where(self._dynamics == _INTEGRATOR, 0.0, present)
        return np.asarray(kept + (values - present) / self._rate)


def _indices(values: Iterable[int]) -> IntArray:
    return np.array(list(values), np.int64)


def _rate(model: mujoco.MjModel, actuator: int) -> float:
    timestep_s = float(model.opt.timestep)
    dynamics = int(model.actuator_dyntype[actuator])
    if dynamics == _INTEGRATOR:
        return timestep_s
    if dynamics == _NONE:
        return 1.0
    constant_s = max(float(model.actuator_dynprm[actuator, 0]), timestep_s)
    if dynamics == int(mujoco.mjtDyn.mjDYN_FILTEREXACT):
        return 1.0 - math.exp(-timestep_s / constant_s)
    return timestep_s / constant_s
