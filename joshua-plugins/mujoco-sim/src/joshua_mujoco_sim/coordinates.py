"""Positions and speeds of the joints of a file in the state of a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial

from joshua_mujoco_sim.transmission import wrapped_joints

if TYPE_CHECKING:
    from joshua_mujoco_sim.drivable import DrivableJoint

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class Coordinates:
    """The positions of some joints, in their order.

    Args:
        model: the compiled model; data: its state; joints: hinges, slides and tendons.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[DrivableJoint]) -> None:
        self._model, self._data = model, data
        self._joints = tuple(joints)
        ids = np.array([max(joint.joint, 0) for joint in joints], np.int64)
        self._qpos: IntArray = model.jnt_qposadr[ids].astype(np.int64)
        #: Degrees of freedom, shape (N,); that of a tendon is of no use.
        self.dof: IntArray = model.jnt_dofadr[ids].astype(np.int64)
        tendons = [place for place, joint in enumerate(joints) if joint.tendon >= 0]
        self._tendon_places: IntArray = np.array(tendons, np.int64)
        self._tendons: IntArray = np.array([joints[place].tendon for place in tendons], np.int64)

    def position(self) -> FloatArray:
        """Return the positions, rad or m, shape (N,), a copy."""
        position = np.array(self._data.qpos[self._qpos])
        if self._tendons.size:
            position[self._tendon_places] = self._data.ten_length[self._tendons]
        return position

    def velocity(self) -> FloatArray:
        """Return the speeds, rad/s or m/s, shape (N,), a copy."""
        velocity = np.array(self._data.qvel[self.dof])
        if self._tendons.size:
            velocity[self._tendon_places] = self._data.ten_velocity[self._tendons]
        return velocity

    def set_position(self, values: FloatArray) -> None:
        """Set the positions at rest, shape (N,), with the joints that follow them.

        A tendon over several joints moves each of them in proportion to its share.
        """
        model, data = self._model, self._data
        present = self.position()
        data.qpos[self._qpos] = np.where(self._is_joint(), values, data.qpos[self._qpos])
        data.qvel[self.dof] = np.where(self._is_joint(), 0.0, data.qvel[self.dof])
        for joint, value, before in zip(self._joints, values, present, strict=True):
            for follower in joint.followers:
                data.qpos[model.jnt_qposadr[follower.joint]] = Polynomial(follower.position)(value)
                data.qvel[model.jnt_dofadr[follower.joint]] = 0.0
            if joint.tendon >= 0:
                self._move_tendon(joint, float(value - before))

    def motion(self) -> FloatArray:
        """Return how fast each degree of freedom moves per unit of speed of each joint, shape (nv, N)."""
        model = self._model
        motion = np.zeros((model.nv, len(self._joints)))
        position = self.position()
        for place, joint in enumerate(self._joints):
            if joint.tendon >= 0:
                row = _row_of_tendon(model, self._data, joint.tendon)
                motion[:, place] = row / max(float(row @ row), 1e-12)
                continue
            motion[self.dof[place], place] = 1.0
            for follower in joint.followers:
                dof = int(model.jnt_dofadr[follower.joint])
                motion[dof, place] = Polynomial(follower.position).deriv()(position[place])
        return motion

    def _is_joint(self) -> npt.NDArray[np.bool_]:
        return np.array([joint.joint >= 0 for joint in self._joints], np.bool_)

    def _move_tendon(self, joint: DrivableJoint, way: float) -> None:
        parts = wrapped_joints(self._model, joint.tendon)
        total = sum(coefficient**2 for _, coefficient in parts)
        for moved, coefficient in parts:
            self._data.qpos[self._model.jnt_qposadr[moved]] += way * coefficient / total
            self._data.qvel[self._model.jnt_dofadr[moved]] = 0.0


def _row_of_tendon(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> FloatArray:
    """Return the derivative of a tendon's length by each degree of freedom, shape (nv,)."""
    row = np.zeros(model.nv)
    parts = wrapped_joints(model, tendon)
    for joint, coefficient in parts:
        row[model.jnt_dofadr[joint]] += coefficient
    if parts:
        return row
    lengths = np.array(data.ten_J)
    if lengths.size == model.ntendon * model.nv:
        return np.asarray(lengths.reshape(model.ntendon, model.nv)[tendon])
    holder = model if hasattr(model, "ten_J_rowadr") else data
    first = int(holder.ten_J_rowadr[tendon])
    columns = slice(first, first + int(holder.ten_J_rownnz[tendon]))
    row[holder.ten_J_colind[columns]] = lengths[columns]
    return row
