"""Summary of a compiled model, for checking names in a file before the start."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from joshua.api import FieldError
from pydantic import BaseModel, ConfigDict

from joshua_mujoco_sim.opengl import RenderingError, check_variable

if TYPE_CHECKING:
    import mujoco

    from joshua_mujoco_sim.drivable import DrivableJoint
    from joshua_mujoco_sim.model_file import Attachment


#: Smallest and largest range of joints that can be calibrated by hand.
SMALLEST_RANGE_RAD, LARGEST_RANGE_RAD = math.radians(20), math.tau + 1e-3


class JointFacts(BaseModel):
    """One joint that can be driven, see ``drivable.DrivableJoint``; ``low`` and ``high`` in its unit.

    ``kind`` is what its actuators take; ``by_hand`` says whether it can be calibrated.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    low: float
    high: float
    unit: Literal["rad", "m"]
    kind: Literal["position", "velocity", "torque"]
    by_hand: bool


class ModelFacts(BaseModel):
    """Content of the compiled model.

    ``actuators`` are the names of the joints that can be driven, in the model's order; ``joints`` has each by
    every name that means it, ``refusals`` the sentence about each actuator that cannot follow positions, by
    every name that means it; ``timestep_s`` is the time step.
    """

    model_config = ConfigDict(frozen=True)

    actuators: tuple[str, ...]
    joints: dict[str, JointFacts]
    refusals: dict[str, str]
    cameras: tuple[str, ...]
    keyframes: tuple[str, ...]
    timestep_s: float

    def known_actuator(self, field: str, name: str) -> JointFacts:
        """Return the joint that a name means. Raises FieldError with the reason or the nearest name."""
        if name in self.joints:
            return self.joints[name]
        if name in self.refusals:
            raise FieldError(
                field,
                f"the model's actuator {self.refusals[name]}, so it cannot be commanded to a position",
                allowed=self.actuators,
                remedy="leave it out, or name a joint that can be driven; see joshua models",
            )
        known_name(field, "actuator or joint", name, self.actuators, also=tuple(self.joints))
        raise AssertionError(name)  # known_name has raised


class AttachedModel(BaseModel):
    """An additional model in the scene, see ``model_file.Attachment``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    model_path: str
    prefix: str
    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0


def attachments(attached: Sequence[AttachedModel]) -> tuple[Attachment, ...]:
    """Return the equivalent for compiling the model."""
    from joshua_mujoco_sim.model_file import Attachment

    return tuple(Attachment(**model.model_dump()) for model in attached)


def facts_of(simulation: Mapping[str, Any]) -> ModelFacts:
    """Return the content of a simulation's model, from its settings as plain values."""
    attached = tuple(AttachedModel.model_validate(values) for values in simulation.get("attached", ()))
    return model_facts(simulation["model_path"], simulation["folder"], attached)


@lru_cache(maxsize=8)
def model_facts(model_path: str, folder: str, attached: tuple[AttachedModel, ...]) -> ModelFacts:
    """Compile a model and return its content. Raises FieldError if it is missing or malformed."""
    try:
        check_variable()
    except RenderingError as error:
        raise FieldError("", error.problem, remedy=error.remedy, code="machine-unfit") from error
    from joshua_mujoco_sim.drivable import drivables
    from joshua_mujoco_sim.model_file import ModelError, load_model
    from joshua_mujoco_sim.summary import summarise

    try:
        model = load_model(model_path, Path(folder) if folder else None, attachments(attached))
    except ModelError as error:
        raise FieldError("model_path", str(error), remedy="correct model_path or the file") from error
    found = drivables(model)
    facts = {joint.name: _facts(model, joint) for joint in found.joints}
    contents = summarise(model)
    return ModelFacts(
        actuators=tuple(facts),
        joints={name: facts[joint.name] for name, joint in found.by_name().items()},
        refusals={name: str(refusal) for name, refusal in found.refused().items()},
        cameras=tuple(contents["cameras"]),
        keyframes=tuple(contents["keyframes"]),
        timestep_s=contents["timestep_s"],
    )


def _facts(model: mujoco.MjModel, joint: DrivableJoint) -> JointFacts:
    """Return the facts of a joint; one that turns between two stops can be calibrated."""
    by_hand = (
        joint.joint >= 0
        and bool(model.jnt_limited[joint.joint])
        and joint.unit == "rad"
        and SMALLEST_RANGE_RAD <= joint.high - joint.low <= LARGEST_RANGE_RAD
    )
    return JointFacts(
        name=joint.name,
        low=joint.low,
        high=joint.high,
        unit=joint.unit,
        kind=joint.kind,
        by_hand=by_hand,
    )


def known_name(field: str, what: str, name: str, known: Sequence[str], also: Sequence[str] = ()) -> None:
    """Check that the model has a name.

    Args:
        field: of the error; what: the kind of thing; name: that is checked.
        known: names to list; also: further ones that are accepted.

    Raises:
        FieldError: with the nearest name first. Things without a name are not listed.
    """
    if name and name in (*known, *also):
        return
    listed = [other for other in known if other]
    near = get_close_matches(name, [*dict.fromkeys((*listed, *also))], n=3, cutoff=0.5)
    raise FieldError(
        field,
        f"the model has no {what} named {name!r}",
        allowed=(*near, *(other for other in listed if other not in near)),
        remedy=f"did you mean {near[0]}?" if near else f"name one of the model's {what}s; see joshua models",
    )
