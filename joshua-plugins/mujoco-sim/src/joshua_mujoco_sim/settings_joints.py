"""Joints that the file names, checked against the model."""

from __future__ import annotations

from collections.abc import Sequence

from joshua.api import FieldError
from pydantic import BaseModel, ConfigDict

from joshua_mujoco_sim.model_facts import ModelFacts, known_name


class JointDrive(BaseModel):
    """Gains of the position loop of one joint: N·m/rad and N·m·s/rad, or N/m and N·s/m."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    joint: str
    position_gain: float
    velocity_gain: float


def check_joints(facts: ModelFacts, names: Sequence[str]) -> None:
    """Check that names mean joints that can be driven, each once. Raises FieldError."""
    if not names:
        refused = "; ".join(list(dict.fromkeys(facts.refusals.values()))[:3])
        raise FieldError(
            "actuators",
            f"the model has no joint that can be driven to a position: {refused or 'it has no actuators'}",
            remedy="name a model with position, velocity or motor actuators on its joints",
        )
    first_of: dict[str, int] = {}
    for index, name in enumerate(names):
        joint = facts.known_actuator(f"actuators[{index}]", name)
        first = first_of.setdefault(joint.name, index)
        if first < index:
            same = "is listed twice" if names[first] == name else f"is the same joint as {names[first]!r}"
            raise FieldError(f"actuators[{index}]", f"{name!r} {same}", remedy="name each joint once")


def check_drives(facts: ModelFacts, names: Sequence[str], drives: Sequence[JointDrive]) -> None:
    """Check that gains are for joints of these names that a position loop drives. Raises FieldError."""
    chosen = {facts.joints[name].name: name for name in names}
    seen: set[str] = set()
    for index, drive in enumerate(drives):
        field = f"drives[{index}].joint"
        joint = facts.joints.get(drive.joint)
        if joint is None or joint.name not in chosen:
            known_name(field, "joint in this node's actuators", drive.joint, tuple(chosen.values()))
            continue
        if joint.name in seen:
            raise FieldError(field, f"{drive.joint!r} has gains already", remedy="remove one of the two")
        seen.add(joint.name)
        if joint.kind == "position":
            raise FieldError(
                field,
                f"the model's actuator of {drive.joint!r} follows positions by gains of its own, so these "
                "have no effect",
                remedy="remove them, or change the gains (kp, kv) in the model",
            )
