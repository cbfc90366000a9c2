"""Summary of a compiled model, for checking names in a file before the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.api import FieldError
from pydantic import BaseModel, ConfigDict

from joshua_mujoco_sim.opengl import RenderingError, check_variable

if TYPE_CHECKING:
    from joshua_mujoco_sim.model_file import Attachment


class ModelFacts(BaseModel):
    """Content of the compiled model; ``ranges`` in radians by actuator, with the joint name.

    ``by_hand`` names the actuators whose joints can be calibrated, ``torque_driven`` those that accept only a
    torque; ``timestep_s`` is the time step.
    """

    model_config = ConfigDict(frozen=True)

    actuators: tuple[str, ...]
    joints: dict[str, str]
    ranges: dict[str, tuple[float, float]]
    by_hand: tuple[str, ...]
    torque_driven: tuple[str, ...]
    cameras: tuple[str, ...]
    keyframes: tuple[str, ...]
    timestep_s: float


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
    from joshua_mujoco_sim.model_file import ModelError, load_model
    from joshua_mujoco_sim.summary import actuated_joints, summarise, torque_driven, turned_by_hand

    try:
        model = load_model(model_path, Path(folder) if folder else None, attachments(attached))
    except ModelError as error:
        raise FieldError("model_path", str(error), remedy="correct model_path or the file") from error
    facts = summarise(model)
    joints = actuated_joints(model)
    unfit = [name for name in facts["actuators"] if name not in joints]
    if unfit:
        raise FieldError(
            "model_path",
            f"the model's actuator {unfit[0]!r} drives no single joint, so it cannot be commanded",
            remedy="give it a joint, or take it out of the model",
        )
    return ModelFacts(
        actuators=tuple(facts["actuators"]),
        joints={name: joint for name, (joint, _, _) in joints.items()},
        ranges={name: (low, high) for name, (_, low, high) in joints.items()},
        by_hand=turned_by_hand(model),
        torque_driven=torque_driven(model),
        cameras=tuple(facts["cameras"]),
        keyframes=tuple(facts["keyframes"]),
        timestep_s=facts["timestep_s"],
    )


def known_name(field: str, what: str, name: str, known: Sequence[str]) -> None:
    """Check that the model has a name. Raises FieldError with the nearest name first."""
    if name in known:
        return
    near = get_close_matches(name, known, n=3, cutoff=0.5)
    raise FieldError(
        field,
        f"the model has no {what} named {name!r}",
        allowed=(*near, *(other for other in known if other not in near)),
        remedy=f"did you mean {near[0]}?" if near else f"name one of the model's {what}s; see joshua models",
    )
