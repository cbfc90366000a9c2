"""Settings of the simulation and of the devices that are part of it, in SI units.

Unlike other settings modules this one compiles the model, because only the model knows its joints, actuators
and cameras: a file with a simulation is checked as a whole before anything starts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from google.protobuf.message import Message
from joshua.plugins.settings import BlockSettings, FieldError, FromField
from pydantic import BaseModel, ConfigDict, model_validator

if TYPE_CHECKING:
    from joshua_mujoco_sim.model_file import Attachment
    from joshua_mujoco_sim.world import WorldSettings

_MOTIONS = {"MOCK_MOTION_NONE": "none", "MOCK_MOTION_SINE": "sine", "MOCK_MOTION_FILE": "file"}


class ModelFacts(BaseModel):
    """What the compiled model has; ``ranges`` in radians by actuator, with the name of its joint."""

    model_config = ConfigDict(frozen=True)

    actuators: tuple[str, ...]
    joints: dict[str, str]
    ranges: dict[str, tuple[float, float]]
    cameras: tuple[str, ...]
    keyframes: tuple[str, ...]


class TopicMapping(BaseModel):
    """One actuator that follows a topic: position · scale + offset."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    ros_topic: str
    mujoco_actuator: str
    offset: float
    scale: float
    joint: str


class Render(BaseModel):
    """Pictures of one camera that go into files; ``output`` is absolute."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    camera: str
    width: int
    height: int
    fps: int
    output: str


class AttachedModel(BaseModel):
    """A further model in the scene, see ``model_file.Attachment``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    model_path: str
    prefix: str
    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0


class SimulationSettings(BlockSettings):
    """Settings of the simulation.

    Attributes:
        mode: how the simulation is run and shown.
        model_path: packaged name or path; folder: where relative paths start.
        mirror_topic_mappings: which topic drives which actuator.
        real_time_factor: simulated time per wall time; 0 for as fast as possible.
        keyframe: where it starts; "" for ``home``.
        on_divergence: what happens when it diverges.
        joint_state_rate_hz: of ``~/joint_states``.
        attached: further models in the scene; renders: pictures that go into files.
        trajectory_path: recording that PASSIVE replays, absolute; episodes: of a data set, () for all.
        replay_speed: how many times faster than recorded; 0 for as fast as possible.
    """

    mode: Literal["INTERACTIVE", "PASSIVE", "MIRROR", "OFFSCREEN"]
    model_path: str
    folder: str = ""
    mirror_topic_mappings: tuple[TopicMapping, ...]
    real_time_factor: float
    keyframe: str
    on_divergence: Literal["DIVERGENCE_RESET", "DIVERGENCE_STOP_RUN"]
    joint_state_rate_hz: float
    attached: tuple[AttachedModel, ...] = ()
    renders: tuple[Render, ...] = ()
    trajectory_path: str
    replay_speed: float
    episodes: tuple[int, ...] = ()

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Adds the folder of the configuration, and the data set where no recording is named."""
        result = super().si_values(values, node, context) | {"folder": context.get("folder", "")}
        folder = Path(result["folder"])
        result["renders"] = [
            render | {"output": str(folder / Path(render["output"]).expanduser())}
            for render in result.get("renders", ())
        ]
        path, stored = result["trajectory_path"], context.get("data_store", {})
        if path:
            result["trajectory_path"] = str(Path(result["folder"]) / Path(path).expanduser())
        elif result["mode"] == "PASSIVE":
            result |= {"trajectory_path": stored.get("path", ""), "episodes": stored.get("episodes", ())}
        return result

    @model_validator(mode="after")
    def _check(self) -> SimulationSettings:
        facts = model_facts(self.model_path, self.folder, self.attached)
        if self.keyframe:
            _known("keyframe", "keyframe", self.keyframe, facts.keyframes)
        for index, mapping in enumerate(self.mirror_topic_mappings):
            field = f"mirror_topic_mappings[{index}].mujoco_actuator"
            _known(field, "actuator", mapping.mujoco_actuator, facts.actuators)
        for index, render in enumerate(self.renders):
            _known(f"renders[{index}].camera", "camera", render.camera, facts.cameras)
            _check_output(index, render.output)
        if self.renders and self.mode != "OFFSCREEN":
            raise FieldError(
                "renders",
                f"renders have an effect only with mode: OFFSCREEN, and the mode is {self.mode}",
                remedy="set mode: OFFSCREEN, or remove them",
            )
        return self

    def world(self) -> WorldSettings:
        """What the physics of this simulation needs; equal for every node of the file."""
        from joshua_mujoco_sim.world import WorldSettings

        return WorldSettings(
            model_path=self.model_path,
            folder=self.folder,
            keyframe=self.keyframe,
            real_time_factor=self.real_time_factor,
            reset_on_divergence=self.on_divergence == "DIVERGENCE_RESET",
            attached=attachments(self.attached),
        )


class SimActuatorSettings(BlockSettings):
    """Settings of actuators of the model.

    Attributes:
        actuators: names, in joint order; never empty.
        joint_ranges: name and limits of the joint of each.
        motion, motion_amplitude_rad, motion_frequency_hz, motion_file: motion without torque.
    """

    actuators: tuple[str, ...]
    motion: Annotated[
        Literal["none", "sine", "file"], FromField("motion", lambda name: _MOTIONS.get(name, name))
    ]
    motion_amplitude_rad: float
    motion_frequency_hz: float
    motion_file: str
    joint_ranges: tuple[dict[str, Any], ...] = ()

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Takes all actuators where none is named, and adds their joints."""
        result = super().si_values(values, node, context)
        simulation = context.get("simulation")
        if not simulation:
            return result
        facts = facts_of(simulation)
        result["actuators"] = tuple(result.get("actuators") or facts.actuators)
        result["joint_ranges"] = [
            {
                "name": facts.joints.get(name, name).rpartition("/")[2],
                "min_rad": facts.ranges.get(name, (0.0, 0.0))[0],
                "max_rad": facts.ranges.get(name, (0.0, 0.0))[1],
                "known": name in facts.ranges,
                "allowed": list(facts.actuators),
            }
            for name in result["actuators"]
        ]
        return result

    @model_validator(mode="after")
    def _check(self) -> SimActuatorSettings:
        for index, (name, joint) in enumerate(zip(self.actuators, self.joint_ranges, strict=False)):
            if not joint["known"]:
                _known(f"actuators[{index}]", "actuator", name, joint["allowed"])
        if self.motion == "file" and not self.motion_file:
            raise FieldError(
                "motion_file",
                "motion is MOCK_MOTION_FILE, and motion_file names no file",
                remedy="name a CSV file in motion_file, or choose another motion",
            )
        return self

    def joints(self) -> list[dict[str, Any]]:
        """Names and limits of the joints, known without a connection."""
        return [{key: joint[key] for key in ("name", "min_rad", "max_rad")} for joint in self.joint_ranges]


class SimCameraSettings(BlockSettings):
    """Settings of a camera of the model: its name, size in pixels, frames per second of simulated time."""

    camera: str
    width: int
    height: int
    fps: int
    cameras: tuple[str, ...] = ()

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Adds the cameras that the model has."""
        result = super().si_values(values, node, context)
        if simulation := context.get("simulation"):
            result["cameras"] = facts_of(simulation).cameras
        return result

    @model_validator(mode="after")
    def _check(self) -> SimCameraSettings:
        if self.cameras:
            _known("camera", "camera", self.camera, self.cameras)
        return self


def _check_output(index: int, output: str) -> None:
    """Refuses a file name that no writer takes. Raises FieldError."""
    field, path = f"renders[{index}].output", Path(output)
    if path.suffix == ".png":
        try:
            numbered = (path.name % 1) != (path.name % 2)
        except (TypeError, ValueError):
            numbered = False
        if not numbered:
            raise FieldError(
                field,
                f"{path.name} is one file, and every picture needs its own",
                allowed=(f"{path.stem}_%05d.png",),
                remedy="put the number of the picture into the name, such as %05d",
            )
    elif path.suffix != ".mp4":
        raise FieldError(
            field,
            f"{path.suffix or 'no ending'} is no known form of pictures",
            allowed=(".mp4", "_%05d.png"),
            remedy="name a .mp4 file, or PNG files by a pattern",
        )


def attachments(attached: Sequence[AttachedModel]) -> tuple[Attachment, ...]:
    """The same as what the model is compiled with."""
    from joshua_mujoco_sim.model_file import Attachment

    return tuple(Attachment(**model.model_dump()) for model in attached)


def facts_of(simulation: Mapping[str, Any]) -> ModelFacts:
    """What the model of a simulation has, given its settings as plain values."""
    attached = tuple(AttachedModel.model_validate(values) for values in simulation.get("attached", ()))
    return model_facts(simulation["model_path"], simulation["folder"], attached)


@lru_cache(maxsize=8)
def model_facts(model_path: str, folder: str, attached: tuple[AttachedModel, ...]) -> ModelFacts:
    """Compiles a model for what it has. Raises FieldError where it is missing or malformed."""
    from joshua_mujoco_sim.model_file import ModelError, load_model
    from joshua_mujoco_sim.summary import actuated_joints, summarise

    try:
        model = load_model(model_path, Path(folder) if folder else None, attachments(attached))
    except ModelError as error:
        raise FieldError("model_path", str(error), remedy="correct model_path or the file") from error
    facts = summarise(model)
    joints = actuated_joints(model)
    return ModelFacts(
        actuators=tuple(facts["actuators"]),
        joints={name: joint for name, (joint, _, _) in joints.items()},
        ranges={name: (low, high) for name, (_, low, high) in joints.items()},
        cameras=tuple(facts["cameras"]),
        keyframes=tuple(facts["keyframes"]),
    )


def _known(field: str, what: str, name: str, known: Sequence[str]) -> None:
    """Refuses a name that the model does not have. Raises FieldError with the nearest name first."""
    if name in known:
        return
    near = get_close_matches(name, known, n=3, cutoff=0.5)
    raise FieldError(
        field,
        f"the model has no {what} named {name!r}",
        allowed=(*near, *(other for other in known if other not in near)),
        remedy=f"did you mean {near[0]}?" if near else f"name one of the model's {what}s; see joshua models",
    )
