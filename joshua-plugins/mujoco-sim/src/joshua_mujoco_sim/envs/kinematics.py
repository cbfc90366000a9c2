"""Inverse kinematics of the SO-ARM100."""

from __future__ import annotations

import mujoco
import numpy as np

from joshua_mujoco_sim.envs.state import FloatArray

#: Joints that place the grip; the sixth is the gripper.
REACHING = 5

#: Where the arm's base turns.
BASE_Y_M = -0.045


def radial(place: FloatArray) -> float:
    """Return the angle about z at which the jaws close across the line from the base to a place, m."""
    return float(np.arctan2(place[0], -(place[1] - BASE_Y_M)))


class Kinematics:
    """Inverse kinematics of the SO-ARM100 on its own data.

    Args:
        model: contains the arm; the arm's joints come first.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._site, self._jaw = model.site("gripper").id, model.body("Fixed_Jaw").id
        self._low, self._high = model.jnt_range[:REACHING].T
        self._jacobians = np.zeros((3, model.nv)), np.zeros((3, model.nv))

    def solve(
        self, joints: FloatArray, target_m: FloatArray, yaw_rad: float | None = None, rounds: int = 12
    ) -> FloatArray:
        """Return joint angles (rad) near ``joints`` that bring the grip to a point.

        Args:
            joints: where the search starts, rad, five.
            target_m: of the grip. With ``yaw_rad`` it points down as far as possible, and the jaws close
                along a horizontal line at that angle about z, in either orientation.
        """
        model, data, (translation, rotation) = self._model, self._data, self._jacobians
        found = np.array(joints)
        for _ in range(rounds):
            data.qpos[:REACHING] = found
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, translation, rotation, self._site)
            rows = [translation[:, :REACHING]]
            errors = [target_m - data.site_xpos[self._site]]
            if yaw_rad is not None:
                frame = data.xmat[self._jaw].reshape(3, 3)
                turn = 0.03 * self._turn(frame, yaw_rad)
                rows.append(0.03 * rotation[:, :REACHING])
                errors.append(turn)
            matrix, error = np.concatenate(rows), np.concatenate(errors)
            normal = matrix.T @ matrix + 3e-4 * np.eye(REACHING)
            change = np.linalg.solve(normal, matrix.T @ error)
            found = np.clip(found + np.clip(change, -0.3, 0.3), self._low, self._high)
        return found

    def place(self, joints: FloatArray) -> FloatArray:
        """Return where the grip is at joint angles (rad, five)."""
        self._data.qpos[:REACHING] = joints
        mujoco.mj_kinematics(self._model, self._data)
        return np.array(self._data.site_xpos[self._site])

    @staticmethod
    def _turn(frame: FloatArray, yaw_rad: float) -> FloatArray:
        """Return the remaining rotation vector (world): fingers (-y) down, x along the line."""
        down = np.cross(-frame[:, 1], (0.0, 0.0, -1.0))
        line = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        line = line if line @ frame[:, 0] >= 0 else -line
        about_z = np.cross(frame[:, 0], line)[2]
        turn: FloatArray = down + np.array([0.0, 0.0, about_z])
        return turn
