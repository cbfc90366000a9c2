"""Content of a model as plain values, for text and JSON."""

from __future__ import annotations

from typing import Any

import mujoco

from joshua_mujoco_sim.cameras import camera_names
from joshua_mujoco_sim.drivable import drivables

_TYPES = {
    mujoco.mjtJoint.mjJNT_FREE: ("free", ""),
    mujoco.mjtJoint.mjJNT_BALL: ("ball", "rad"),
    mujoco.mjtJoint.mjJNT_SLIDE: ("slide", "m"),
    mujoco.mjtJoint.mjJNT_HINGE: ("hinge", "rad"),
}


def summarise(model: mujoco.MjModel) -> dict[str, Any]:
    """List joints with a name, what can be driven, cameras and keyframes; mass in kg, time step in s."""
    found = drivables(model)
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
        "actuators": [joint.name for joint in found.joints],
        "drivable": [
            {
                "name": joint.name,
                "names": list(joint.names),
                "unit": joint.unit,
                "range": [joint.low, joint.high],
                "limited": joint.limited,
                "kind": joint.kind,
                "driven_by": joint.how,
            }
            for joint in found.joints
        ],
        "not_drivable": [{"name": one.actuator, "reason": one.reason} for one in found.refusals],
        "cameras": camera_names(model),
        "keyframes": [model.key(index).name for index in range(model.nkey)],
    }
