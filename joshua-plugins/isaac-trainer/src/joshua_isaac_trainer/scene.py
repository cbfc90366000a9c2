"""What stands in the scene beside the robot, read from the MuJoCo model of a task. Without Isaac Lab."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
from joshua_mujoco_sim.envs import common_terms as common
from joshua_mujoco_sim.envs.terms import Task

from joshua_isaac_trainer.robot import AssetError, drives, robot_bodies

#: Distance between the copies of the scene, and the physics step that PhysX takes.
SPACING_M, PHYSICS_S = 1.5, 0.005

#: Friction of the robot and of what says no other, and materials of which each shape gets one at random.
FRICTION, MATERIALS = 1.0, 64


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


@dataclass(frozen=True)
class Event:
    """An event of Isaac Lab that varies the physics.

    Attributes:
        function: its name in ``isaaclab.envs.mdp``; mode: when it happens.
        asset: name in the scene; parts: its parts, by the field of ``SceneEntityCfg``.
        parameters: further arguments of the function.
    """

    function: str
    mode: str
    asset: str
    parts: Mapping[str, str]
    parameters: Mapping[str, Any]


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


def randomisation(task: Task, model: mujoco.MjModel) -> dict[str, Event]:
    """Return the events of ``randomise``, by name: what the task varies in MuJoCo, in the same ranges.

    A drive of PhysX has the damping of the servo and of the joint in one; the task varies that of the joint.
    Servos, damping and dry friction change with each episode. PhysX takes friction of contacts from few
    materials, which the copies of the scene get once, at the start.

    Raises:
        AssetError: the task varies nothing, or something that Isaac Lab has no event for.
    """
    if not task.randomisation:
        raise AssetError(f"randomise has no effect: the task on {task.model_path} varies nothing")
    found: dict[str, Event] = {}
    for term in task.randomisation:
        factors = (float(term.parameters["low"]), float(term.parameters["high"]))
        is_gain = term.function is common.randomise_servos
        field = "" if is_gain else str(term.parameters.get("field", term.name))
        if field == "geom_friction":
            nominal = {"robot": FRICTION} | {
                box.name: box.friction for box in parts(model) if box.mass_kg is not None
            }
            found |= {
                f"{term.name}_{name}": _touch(name, factors, friction) for name, friction in nominal.items()
            }
        elif field in _DRIVES:
            function, argument = _DRIVES[field]
            if field == "dof_damping":
                factors = _of_drives(model, term.name, factors)
            varied = {argument: factors, "operation": "scale"}
            found[term.name] = Event(function, "reset", "robot", {"joint_names": ".*"}, varied)
        else:
            raise AssetError(f"randomise: Isaac Lab has no event for {term.name} of {task.model_path}")
    return found


#: Function and argument of Isaac Lab that vary a field of the model; "" is the gain of servos.
_DRIVES = {
    "": ("randomize_actuator_gains", "stiffness_distribution_params"),
    "dof_damping": ("randomize_actuator_gains", "damping_distribution_params"),
    "dof_frictionloss": ("randomize_joint_parameters", "friction_distribution_params"),
}


def _of_drives(model: mujoco.MjModel, term: str, factors: tuple[float, float]) -> tuple[float, float]:
    """Return the factors of the damping of the drives: that of the servo, which stays, and that of the joint.

    Raises:
        AssetError: one range for all drives cannot express it.
    """
    found = set()
    for name, drive in drives(model).items():
        joint = float(model.dof_damping[model.joint(name).dofadr[0]])
        whole = drive.damping or 1.0
        low, high = (round((drive.damping - joint + factor * joint) / whole, 9) for factor in factors)
        found.add((low, high))
    if len(found) != 1:
        raise AssetError(
            f"randomise: {term} changes the damping of the drives by different factors, {sorted(found)}, and "
            "an event of Isaac Lab has one range: give all joints the same share of their drives' damping"
        )
    return found.pop()


def _touch(asset: str, factors: tuple[float, float], friction: float) -> Event:
    low, high = factors
    friction_range = (low * friction, high * friction)
    return Event(
        "randomize_rigid_body_material",
        "startup",
        asset,
        {"body_names": ".*"},
        {
            "static_friction_range": friction_range,
            "dynamic_friction_range": friction_range,
            "restitution_range": (0.0, 0.0),
            "num_buckets": MATERIALS,
            "make_consistent": True,  # else a shape could slide with more friction than it rests with
        },
    )


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, float, float]:
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return float(rgba[0]), float(rgba[1]), float(rgba[2])
