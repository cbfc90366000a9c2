"""The robot for Isaac Sim: its drives, and its model as a URDF file, which Isaac Lab converts to USD."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import numpy.typing as npt
from joshua.api.files import safe_name
from joshua_training.run_folder import RunError

FloatArray = npt.NDArray[np.float64]

#: Mass of a link without one, kg: only of a base that does not move.
_BASE_KG = 1.0

#: Speed limit in the URDF, rad/s; the drives limit the torque.
_FASTEST_RAD_S = 50.0


#: Highest group of shapes that MuJoCo shows.
_SEEN = 2


class AssetError(RunError):
    """The model cannot be used in Isaac Sim; the message says why and what to do."""


@dataclass(frozen=True)
class Drive:
    """Position drive of a joint as PhysX computes it: ``stiffness * error - damping * speed``, limited.

    Attributes:
        stiffness: N m/rad; damping: N m s/rad, of the servo and of the joint; effort: N m; armature: kg m²;
            friction: dry friction, N m.
    """

    stiffness: float
    damping: float
    effort: float
    armature: float
    friction: float


def drives(model: mujoco.MjModel) -> dict[str, Drive]:
    """Return the drive of each joint, by name, from the position servos of a MuJoCo model.

    Raises:
        AssetError: an actuator is no position servo of a joint.
    """
    found = {}
    for index in range(model.nu):
        if (
            model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT
            or model.actuator_biastype[index] != mujoco.mjtBias.mjBIAS_AFFINE
        ):
            raise AssetError(f"{model.actuator(index).name} is no position servo of a joint")
        joint = int(model.actuator_trnid[index, 0])
        dof = int(model.jnt_dofadr[joint])
        found[model.joint(joint).name] = Drive(
            stiffness=float(model.actuator_gainprm[index, 0]),
            damping=float(-model.actuator_biasprm[index, 2] + model.dof_damping[dof]),
            effort=float(model.actuator_forcerange[index, 1]) or math.inf,
            armature=float(model.dof_armature[dof]),
            friction=float(model.dof_frictionloss[dof]),
        )
    return found


def robot_bodies(model: mujoco.MjModel) -> list[int]:
    """Return the bodies of the robot: the tree of the first body that carries a joint, fixed base included.

    Raises:
        AssetError: the model has no such tree.
    """
    hinges = [int(model.jnt_bodyid[j]) for j in range(model.njnt) if _turns(model, j)]
    if not hinges:
        raise AssetError("the model has no hinge joint")
    root = int(model.body_rootid[hinges[0]])
    return [body for body in range(1, model.nbody) if int(model.body_rootid[body]) == root]


def urdf_of(model: mujoco.MjModel, name: str) -> str:
    """Return the robot of a model as URDF: links, inertias, hinges with limits, boxes and the like.

    Meshes are left out: they are only seen. Isaac Lab fixes the base.

    Raises:
        AssetError: a joint of the robot is no hinge at its body's origin.
    """
    robot = Xml.Element("robot", name=name)
    bodies = robot_bodies(model)
    efforts = drives(model)
    for body in bodies:
        link = Xml.SubElement(robot, "link", name=model.body(body).name)
        _add_inertial(link, model, body)
        for geom in range(model.ngeom):
            if int(model.geom_bodyid[geom]) == body:
                _add_geom(link, model, geom)
    for body in bodies[1:]:
        joints = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) == body]
        if len(joints) > 1 or any(not _turns(model, j) or model.jnt_pos[j].any() for j in joints):
            raise AssetError(f"{model.body(body).name} is not on a hinge at its origin")
        kind = "revolute" if joints else "fixed"
        label = model.joint(joints[0]).name if joints else f"{model.body(body).name}_fixed"
        joint = Xml.SubElement(robot, "joint", name=label, type=kind)
        _add_origin(joint, model.body_pos[body], model.body_quat[body])
        Xml.SubElement(joint, "parent", link=model.body(model.body_parentid[body]).name)
        Xml.SubElement(joint, "child", link=model.body(body).name)
        if joints:
            low, high = model.jnt_range[joints[0]]
            effort = efforts[label].effort if label in efforts else 0.0
            Xml.SubElement(joint, "axis", xyz=_row(model.jnt_axis[joints[0]]))
            Xml.SubElement(
                joint,
                "limit",
                lower=f"{low:.9g}",
                upper=f"{high:.9g}",
                effort=f"{effort:.9g}",
                velocity=f"{_FASTEST_RAD_S:g}",
            )
    Xml.indent(robot)
    return Xml.tostring(robot, encoding="unicode") + "\n"


def write_urdf(model: mujoco.MjModel, name: str, folder: Path) -> Path:
    """Write the URDF of a model's robot into a folder, named after its content, and return its path.

    Isaac Lab converts a file once and looks at its name alone to see whether it did; the name has one dot,
    which its converter requires. Raises AssetError, OSError; UnsafePathError for a name that cannot be one.
    """
    safe_name(name, "the robot")
    text = urdf_of(model, name)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.urdf"
    if not path.is_file():
        draft = path.with_suffix(".part")
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)
    return path


def _turns(model: mujoco.MjModel, joint: int) -> bool:
    return bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE)


def _add_inertial(link: Xml.Element, model: mujoco.MjModel, body: int) -> None:
    inertial = Xml.SubElement(link, "inertial")
    mass = float(model.body_mass[body])
    moments = model.body_inertia[body] if mass else np.full(3, 1e-3)
    _add_origin(inertial, model.body_ipos[body], model.body_iquat[body])
    Xml.SubElement(inertial, "mass", value=f"{mass or _BASE_KG:.9g}")
    zeros = {"ixy": "0", "ixz": "0", "iyz": "0"}
    values = dict(zip(("ixx", "iyy", "izz"), (f"{m:.9g}" for m in moments), strict=True))
    Xml.SubElement(inertial, "inertia", {**values, **zeros})


def _add_geom(link: Xml.Element, model: mujoco.MjModel, geom: int) -> None:
    """Add a shape: to collide with, if it collides in the model, else to be seen."""
    shape = dict(_shape(model, geom))
    collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
    if not shape or (not collides and model.geom_group[geom] > _SEEN):
        return
    part = Xml.SubElement(link, "collision" if collides else "visual")
    _add_origin(part, model.geom_pos[geom], model.geom_quat[geom])
    geometry = Xml.SubElement(part, "geometry")
    for tag, attributes in shape.items():
        Xml.SubElement(geometry, tag, attributes)


def _shape(model: mujoco.MjModel, geom: int) -> Iterator[tuple[str, dict[str, str]]]:
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        yield "box", {"size": _row(2.0 * size)}
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        yield "sphere", {"radius": f"{size[0]:.9g}"}
    elif kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        yield "cylinder", {"radius": f"{size[0]:.9g}", "length": f"{2.0 * size[1]:.9g}"}


def _add_origin(parent: Xml.Element, position: FloatArray, attitude: FloatArray) -> None:
    Xml.SubElement(parent, "origin", xyz=_row(position), rpy=_row(roll_pitch_yaw(attitude)))


def roll_pitch_yaw(attitude: FloatArray) -> FloatArray:
    """Return the angles of a unit quaternion (w, x, y, z) about the fixed axes x, y, z, rad."""
    w, x, y, z = attitude
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > 1.0 - 1e-12:  # straight up or down: only the sum of the other two matters
        return np.array([2.0 * math.atan2(x, w), math.copysign(math.pi / 2, sine), 0.0])
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.array([roll, math.asin(sine), yaw])


def _row(values: FloatArray) -> str:
    return " ".join(f"{value:.9g}" for value in values)
