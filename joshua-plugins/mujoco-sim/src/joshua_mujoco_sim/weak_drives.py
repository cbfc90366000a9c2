"""Position drives of a model that are too soft to hold their joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.coordinates import Coordinates
from joshua_mujoco_sim.drives import Drives

if TYPE_CHECKING:
    from joshua_mujoco_sim.drivable import DrivableJoint

FloatArray = npt.NDArray[np.float64]

#: Share of a joint's range by which a position drive may miss its goal because of weight and springs.
LARGEST_SAG_SHARE = 0.03

#: Shares of the ranges of all joints at which the drives are judged, beside the initial position.
JUDGED_SHARES = (0.2, 0.8)


def too_soft(model: mujoco.MjModel, joints: Sequence[DrivableJoint]) -> npt.NDArray[np.bool_]:
    """Return which position drives miss their goals by more than ``LARGEST_SAG_SHARE``, shape (N,).

    Args:
        model: the compiled model; joints: with position drives.
    """
    data = mujoco.MjData(model)
    coordinates, drives = Coordinates(model, data, joints), Drives(model, data, joints)
    low = np.array([joint.low for joint in joints])
    high = np.array([joint.high for joint in joints])
    mujoco.mj_forward(model, data)
    largest = _sag(data, coordinates, drives)
    for share in JUDGED_SHARES:
        mujoco.mj_resetData(model, data)
        coordinates.set_position(low + share * (high - low))
        mujoco.mj_forward(model, data)
        largest = np.maximum(largest, _sag(data, coordinates, drives))
    return np.asarray(largest > LARGEST_SAG_SHARE * (high - low))


def _sag(data: mujoco.MjData, coordinates: Coordinates, drives: Drives) -> FloatArray:
    """Return how far weight and springs pull each joint from its goal at rest, rad or m, shape (N,)."""
    load = coordinates.motion().T @ (data.qfrc_bias - data.qfrc_spring - data.qfrc_gravcomp)
    return np.asarray(np.abs(load) / drives.stiffness(coordinates.position()))
