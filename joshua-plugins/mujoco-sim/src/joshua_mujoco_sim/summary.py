"""Content of a model as plain values, for text and JSON."""

from __future__ import annotations

import math
from typing import Any

import mujoco

from joshua_mujoco_sim.cameras import camera_names

_TYPES = {
    mujoco.mjtJoint.mjJNT_FREE: ("free", ""),
    mujoco.mjtJoint.mjJNT_BALL: ("ball", "rad"),
    mujoco.mjtJoint.mjJNT_SLIDE: ("slide", "m"),
    mujoco.mjtJoint.mjJNT_HINGE: ("hinge", "rad"),
}


def summarise(model: mujoco.MjModel) -> dict[str, Any]:
    """List named joints with their ranges, actuators, cameras and keyframes; mass in kg, time step in s."""
    joints = []
    for index in range(model.njnt):
        joint = model.joint(index)
        kind, unit = _TYPES[mujoco.mjtJoint(model.jnt_type[index])]
        limits = [float(value) for value in joint.range] if model.jnt_limited[index] else None
        if joint.name:
            joints.append({"name": joint.name, "type": kind, "unit": unit, "range": limits})
    return {
        "mass_kg": float(model.body_mass.sum()),
        "timestep_s": float(model.opt.timestep),
        "joints": joints,
        "actuators": [model.actuator(index).name for index in range(model.nu)],
        "cameras": camera_names(model),
        "keyframes": [model.key(index).name for index in range(model.nkey)],
    }


def actuated_joints(model: mujoco.MjModel) -> dict[str, tuple[str, float, float]]:
    """Return joint and limits in radians by actuator; without limits, one turn to both sides."""
    found = {}
    for index in range(model.nu):
        if model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint = int(model.actuator_trnid[index, 0])
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-math.tau, math.tau)
        found[model.actuator(index).name] = (model.joint(joint).name, float(low), float(high))
    return found


def torque_driven(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the actuators that accept only a torque, such as ``<motor>``."""
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    takes_goals = affine & (model.actuator_biasprm[:, 1] <= 0)
    return tuple(model.actuator(index).name for index in range(model.nu) if not takes_goals[index])


#: Smallest and largest range of joints that can be calibrated by hand.
SMALLEST_RANGE_RAD, LARGEST_RANGE_RAD = math.radians(20), math.tau + 1e-3


def turned_by_hand(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the actuators of joints between two stops, which can be calibrated."""
    found = []
    for index in range(model.nu):
        joint = int(model.actuator_trnid[index, 0])
        if model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT or not model.jnt_limited[joint]:
            continue
        low, high = model.jnt_range[joint]
        is_hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        if is_hinge and SMALLEST_RANGE_RAD <= high - low <= LARGEST_RANGE_RAD:
            found.append(model.actuator(index).name)
    return tuple(found)
