"""URDF import that adds what a simulation needs: joint drives, a light and a sky."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

#: Stiffness of a drive without an effort limit, as natural frequency of the joint.
FREQUENCY_RAD_S = 30.0

#: Smallest useful stiffness, and the largest that is stable at the time step.
FREQUENCIES_RAD_S = (5.0, 100.0)

#: With an effort limit, the drive reaches it at this distance from its goal.
FULL_EFFORT_RAD = 0.1

_DRIVEN = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


def is_urdf(path: Path) -> bool:
    """Return whether a file is a URDF description, that is, its root is a robot. Raises OSError."""
    with path.open("rb") as file:
        head = file.read(65536)
    robot, mujoco_element = head.find(b"<robot"), head.find(b"<mujoco")
    return robot >= 0 and (mujoco_element < 0 or robot < mujoco_element)


def read_urdf(path: Path) -> mujoco.MjSpec:
    """Read a URDF file and add a position drive for each joint, named after it, and a light.

    Args:
        path: of the file.

    Raises:
        ValueError: MuJoCo cannot compile it.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.discardvisual = False  # which would also remove the sky
    model = spec.compile()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if not spec.actuators:
        _add_drives(spec, model)
    _exclude_neighbours(spec)
    if not spec.lights:
        spec.worldbody.add_light(
            pos=[*model.stat.center[:2], model.stat.center[2] + 3.0 * model.stat.extent],
            dir=[0.2, 0.3, -1.0],
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            diffuse=[0.8, 0.8, 0.8],
            castshadow=False,
        )
    if not spec.textures:
        _add_sky(spec)
    return spec


def _add_drives(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for joint in spec.joints:
        if joint.type not in _DRIVEN:
            continue
        compiled = model.joint(joint.name)
        mass = max(_inertia(model, data, int(compiled.dofadr[0])), 1e-6)
        effort = float(model.jnt_actfrcrange[compiled.id, 1]) if model.jnt_actfrclimited[compiled.id] else 0.0
        wanted = effort / FULL_EFFORT_RAD or FREQUENCY_RAD_S**2 * mass
        slowest, fastest = FREQUENCIES_RAD_S
        stiffness = float(np.clip(wanted, slowest**2 * mass, fastest**2 * mass))
        drive = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gaintype, drive.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = stiffness
        drive.biasprm[1], drive.biasprm[2] = -stiffness, -2.0 * np.sqrt(stiffness * mass)
        if model.jnt_limited[compiled.id]:
            drive.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
            drive.ctrlrange = model.jnt_range[compiled.id]
        if effort:
            drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            drive.forcerange = [-effort, effort]


def _inertia(model: mujoco.MjModel, data: mujoco.MjData, dof: int) -> float:
    """Return the inertia at a joint in the model's pose, kg·m² or kg."""
    unit, product = np.zeros(model.nv), np.zeros(model.nv)
    unit[dof] = 1.0
    mujoco.mj_mulM(model, data, product, unit)
    return float(product[dof])


def _exclude_neighbours(spec: mujoco.MjSpec) -> None:
    """Exclude contacts between a link and its parent; MuJoCo does so for moving parents only."""
    for body in spec.bodies:
        if body.joints and body.parent is not None:
            spec.add_exclude(bodyname1=body.parent.name, bodyname2=body.name)


def _add_sky(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.62, 0.72, 0.82],
        rgb2=[0.90, 0.93, 0.96],
        width=64,
        height=384,
    )
