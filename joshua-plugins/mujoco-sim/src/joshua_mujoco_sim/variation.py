"""Variation of a scene by seed at each start: joints, free objects, lights and cameras."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Variation:
    """Largest changes of a scene, drawn uniformly.

    Attributes:
        seed: the same seed gives the same sequence of scenes.
        joint_rad: of joints with a position drive; object_m: of free objects, along x and y.
        light: of the brightness of each light, and of its position relative to its height.
        camera_m, camera_rad: of each camera, along and about each axis.
    """

    seed: int
    joint_rad: float
    object_m: float
    light: float
    camera_m: float
    camera_rad: float


class Varier:
    """Varies one model and its state.

    Args:
        model: as compiled; every variation starts from it.
        variation: largest changes.
    """

    def __init__(self, model: mujoco.MjModel, variation: Variation) -> None:
        self._model = model
        self._variation = variation
        self._light_pos = np.array(model.light_pos)
        self._light_diffuse, self._light_dir = np.array(model.light_diffuse), np.array(model.light_dir)
        self._headlight = np.array(model.vis.headlight.diffuse)
        self._cam_pos, self._cam_quat = np.array(model.cam_pos), np.array(model.cam_quat)
        driven = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_biasprm[:, 1] < 0)
        self._drives = np.flatnonzero(driven)
        self._free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)

    def apply(self, data: mujoco.MjData, start: int) -> None:
        """Vary a state after a reset. The caller runs ``mj_forward``.

        Args:
            data: of the model; start: its index, from 0.
        """
        # every value is drawn, even with size 0, so one setting does not affect the others
        chance = np.random.default_rng((self._variation.seed, start))
        self._joints(data, chance)
        self._objects(data, chance)
        self._lights(chance)
        self._cameras(chance)

    def _joints(self, data: mujoco.MjData, chance: np.random.Generator) -> None:
        model, reach = self._model, self._variation.joint_rad
        for drive in self._drives:
            joint = int(model.actuator_trnid[drive, 0])
            value = data.qpos[model.jnt_qposadr[joint]] + reach * chance.uniform(-1, 1)
            if model.jnt_limited[joint]:
                value = np.clip(value, *model.jnt_range[joint])
            data.qpos[model.jnt_qposadr[joint]] = data.ctrl[drive] = value

    def _objects(self, data: mujoco.MjData, chance: np.random.Generator) -> None:
        reach = self._variation.object_m
        for joint in self._free:
            start = int(self._model.jnt_qposadr[joint])
            shift, turn = chance.uniform(-1, 1, 2), chance.uniform(-np.pi, np.pi)
            if reach:
                data.qpos[start : start + 2] += reach * shift
                about = np.array([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
                attitude = data.qpos[start + 3 : start + 7]
                mujoco.mju_mulQuat(attitude, about, attitude.copy())

    def _lights(self, chance: np.random.Generator) -> None:
        model, part = self._model, self._variation.light
        count = model.nlight
        factor = 1 + part * chance.uniform(-1, 1, (count, 1))
        model.light_diffuse[:] = np.clip(self._light_diffuse * factor, 0.0, 1.0)
        sideways = part * chance.uniform(-1, 1, (count, 2)) * self._light_pos[:, 2:]
        model.light_pos[:, :2] = self._light_pos[:, :2] + sideways
        for light in range(count):  # keep it aimed at the same point
            down = -self._light_dir[light, 2]
            if down > 0:
                aim = self._light_pos[light] + self._light_dir[light] * self._light_pos[light, 2] / down
                way = aim - model.light_pos[light]
                model.light_dir[light] = way / np.linalg.norm(way)
        model.vis.headlight.diffuse = np.clip(self._headlight * (1 + part * chance.uniform(-1, 1)), 0.0, 1.0)

    def _cameras(self, chance: np.random.Generator) -> None:
        model, variation = self._model, self._variation
        for camera in range(model.ncam):
            shift, axis = chance.uniform(-1, 1, 3), chance.uniform(-1, 1, 3)
            turn: FloatArray = variation.camera_rad * axis
            model.cam_pos[camera] = self._cam_pos[camera] + variation.camera_m * shift
            model.cam_quat[camera] = self._cam_quat[camera]
            mujoco.mju_quatIntegrate(model.cam_quat[camera], turn, 1.0)
