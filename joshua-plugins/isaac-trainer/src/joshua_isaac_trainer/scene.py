"""What stands in the scene beside the robot, read from the MuJoCo model of a task. Without Isaac Lab."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from joshua_isaac_trainer.robot import AssetError, robot_bodies

#: Distance between the copies of the scene, and the physics step that PhysX takes.
SPACING_M, PHYSICS_S = 1.5, 0.005

#: Ranges of the factors by which ``randomise`` varies the physics, those of the tasks in MuJoCo.
RANDOMISED: Mapping[str, tuple[float, float]] = {
    "servo_gain": (0.8, 1.2),
    "damping": (0.7, 1.3),
    "dry_friction": (0.5, 1.5),
    "contact_friction": (0.7, 1.3),
}


@dataclass(frozen=True)
class Box:
    """A box: free with a mass, fixed without one.

    Attributes:
        size_m: lengths of its edges; position_m: of its middle; colour: red, green, blue from 0 to 1.
    """

    name: str
    size_m: tuple[float, float, float]
    position_m: tuple[float, float, float]
    mass_kg: float | None
    friction: float
    colour: tuple[float, float, float]


def decimation(step_s: float) -> int:
    """Return the physics steps of one action."""
    return max(1, round(step_s / PHYSICS_S))


def free_bodies(model: mujoco.MjModel) -> dict[str, slice]:
    """Return the free bodies of a model, with their columns in ``qpos``."""
    found = {}
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            first = int(model.jnt_qposadr[joint])
            found[model.body(model.jnt_bodyid[joint]).name] = slice(first, first + 7)
    return found


def parts(model: mujoco.MjModel) -> list[Box]:
    """Return the boxes of a model that can be touched and belong to no robot.

    Raises:
        AssetError: a free body is no single box.
    """
    robot = set(robot_bodies(model))
    free = free_bodies(model)
    found: list[Box] = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        if body in robot or not collides or model.body_mocapid[body] >= 0:
            continue
        is_box = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
        name = model.body(body).name if body else model.geom(geom).name
        if body and (name not in free or not is_box or name in {box.name for box in found}):
            raise AssetError(f"{name} is no single box: only boxes can lie in a scene of Isaac Lab here")
        if not is_box:
            continue  # a floor below the table
        x, y, z = (2.0 * float(half) for half in model.geom_size[geom])
        place = model.body_pos[body] + model.geom_pos[geom]
        red, green, blue = (float(part) for part in _colour(model, geom))
        found.append(
            Box(
                name=name,
                size_m=(x, y, z),
                position_m=(float(place[0]), float(place[1]), float(place[2])),
                mass_kg=float(model.body_mass[body]) if body else None,
                friction=float(model.geom_friction[geom, 0]),
                colour=(red, green, blue),
            )
        )
    return found


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, float, float]:
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return float(rgba[0]), float(rgba[1]), float(rgba[2])
