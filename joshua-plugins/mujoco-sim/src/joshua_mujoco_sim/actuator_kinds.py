"""One actuator of a model: where its values are, what it takes, and whether it can follow positions."""

from __future__ import annotations

from typing import Literal

import mujoco

from joshua_mujoco_sim.transmission import single_joints

Kind = Literal["position", "velocity", "torque"]

#: Of several actuators of one joint, those of the first kind drive it; the others apply no command.
KINDS: tuple[Kind, ...] = ("position", "velocity", "torque")


def actuator_count(model: mujoco.MjModel) -> int:
    """Return the number of actuators, of which each has one or more controls since MuJoCo 4."""
    return len(model.actuator_trntype)


def control_of(model: mujoco.MjModel, actuator: int) -> int:
    """Return the index of an actuator's first control."""
    addresses = getattr(model, "actuator_ctrladr", None)
    return actuator if addresses is None else int(addresses[actuator])


def output_of(model: mujoco.MjModel, actuator: int) -> int:
    """Return the index of an actuator's first force."""
    addresses = getattr(model, "actuator_outadr", None)
    return actuator if addresses is None else int(addresses[actuator])


def actuator_name(model: mujoco.MjModel, actuator: int) -> str:
    """Return the name of an actuator; "" if it has none."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator) or ""


def kind_of(model: mujoco.MjModel, actuator: int) -> Kind:
    """Return what an actuator's control is, roughly: a position, a velocity, or a force."""
    if model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
        return "torque"
    _, per_length, per_speed = model.actuator_biasprm[actuator, :3]
    if per_length < 0:
        return "position"
    return "velocity" if per_length == 0 and per_speed < 0 else "torque"


_TRANSMISSIONS = {
    mujoco.mjtTrn.mjTRN_SITE: "pushes at a site and moves no joint of its own",
    mujoco.mjtTrn.mjTRN_BODY: "is an adhesion, which attracts bodies and moves no joint",
    mujoco.mjtTrn.mjTRN_SLIDERCRANK: "drives a slider crank, whose position has no range in the model",
}

JOINT_TRANSMISSIONS = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)

_DYNAMICS = (
    mujoco.mjtDyn.mjDYN_NONE,
    mujoco.mjtDyn.mjDYN_INTEGRATOR,
    mujoco.mjtDyn.mjDYN_FILTER,
    mujoco.mjtDyn.mjDYN_FILTEREXACT,
)


def reason_against(model: mujoco.MjModel, actuator: int) -> str:
    """Return why an actuator cannot be driven to a position; "" if it can."""
    transmission = mujoco.mjtTrn(model.actuator_trntype[actuator])
    gain = mujoco.mjtGain(model.actuator_gaintype[actuator])
    bias = mujoco.mjtBias(model.actuator_biastype[actuator])
    dynamics = mujoco.mjtDyn(model.actuator_dyntype[actuator])
    if mujoco.mjtDyn.mjDYN_MUSCLE == dynamics or mujoco.mjtGain.mjGAIN_MUSCLE == gain:
        return "is a muscle, which takes an activation and no position"
    if transmission in _TRANSMISSIONS:
        return _TRANSMISSIONS[transmission]
    if transmission not in (*JOINT_TRANSMISSIONS, mujoco.mjtTrn.mjTRN_TENDON):
        return "drives neither a hinge, nor a slide, nor a tendon"
    if transmission in JOINT_TRANSMISSIONS:
        joint = int(model.actuator_trnid[actuator, 0])
        if joint not in single_joints(model):
            kind = "ball" if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL else "free"
            return f"drives the {kind} joint {_name_of_joint(model, joint)}, which has no single position"
    if model.actuator_plugin[actuator] >= 0:
        return "is computed by a plugin of MuJoCo, which JOSHUA does not know"
    known_gain = gain in (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_AFFINE)
    known_bias = bias in (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
    if not (known_gain and known_bias and dynamics in _DYNAMICS):
        named = f"{gain.name[7:]}, {bias.name[7:]}, {dynamics.name[6:]}".lower()
        return f"computes its force by rules of its own (gain, bias, dynamics: {named})"
    if model.actuator_gainprm[actuator, 0] == 0:
        if gain == mujoco.mjtGain.mjGAIN_AFFINE and model.actuator_gainprm[actuator, 2] != 0:
            return "is a damper, which only brakes"
        return "has no gain, so its command has no effect"
    if not model.actuator_gear[output_of(model, actuator), 0]:
        return "has a gear of 0, so its force has no effect"
    return ""


def _name_of_joint(model: mujoco.MjModel, joint: int) -> str:
    return model.joint(joint).name or f"number {joint}"


def activation_of(model: mujoco.MjModel, actuator: int) -> int:
    """Return the index of an actuator's last activation, which multiplies its gain; -1 if it has none."""
    first = int(model.actuator_actadr[actuator])
    return first if first < 0 else first + int(model.actuator_actnum[actuator]) - 1
