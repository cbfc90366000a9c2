"""Settings of the simulation and of the devices that are part of it, in SI units.

Unlike other settings modules, this one compiles the model, because only the model knows its joints, actuators
and cameras. A file with a simulation is therefore checked completely before the start.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from google.protobuf.message import Message
from joshua.api import ActuatorSettings, BlockContext, BlockSettings, FieldError, FromField, JointRange
from joshua.api.calibration import ArmCalibration
from pydantic import Field, model_validator

from joshua_mujoco_sim.calibration import IDENTITY, Frame, frames, misfits
from joshua_mujoco_sim.model_facts import (
    AttachedModel,
    ModelFacts,
    attachments,
    facts_of,
    known_name,
    model_facts,
)
from joshua_mujoco_sim.settings_joints import JointDrive, check_drives, check_joints
from joshua_mujoco_sim.settings_parts import (
    DatasetSettings,
    Render,
    TopicMapping,
    VariationSettings,
    check_frames,
    check_output,
    check_outputs,
    check_picture_keys,
    check_recording,
    require_pictures,
    variation,
    variation_defaults,
)

if TYPE_CHECKING:
    from joshua_mujoco_sim.world import WorldSettings

_UNITS = {
    "TRAJECTORY_UNIT_AUTO": "",
    "TRAJECTORY_UNIT_RADIANS": "rad",
    "TRAJECTORY_UNIT_DEGREES": "deg",
    "TRAJECTORY_UNIT_LEROBOT": "lerobot",
    "TRAJECTORY_UNIT_LEROBOT_DEGREES": "lerobot_deg",
}

#: Models of the tasks that have a demonstrator (``envs.experts.EXPERTS``).
_DEMONSTRATED = {
    "joshua/SoArm100Reach-v0": "so_arm100/reach.xml",
    "joshua/SoArm100PickPlace-v0": "so_arm100/pick_place.xml",
}

_MOTIONS = {"MOCK_MOTION_NONE": "none", "MOCK_MOTION_SINE": "sine", "MOCK_MOTION_FILE": "file"}


class SimulationSettings(BlockSettings):
    """Settings of the simulation.

    Attributes:
        mode: of running and showing the simulation.
        model_path: packaged name or path; folder: base of relative paths.
        mirror_topic_mappings: which topic drives which actuator.
        real_time_factor: simulated time per wall time; 0 means as fast as possible.
        keyframe: initial state; "" for ``home``.
        on_divergence: reaction to a divergence.
        joint_state_rate_hz: of ``~/joint_states``.
        attached: additional models in the scene; renders: pictures to write to files.
        trajectory_path: recording that PASSIVE replays, absolute; episodes: of a data set, () for all.
        trajectory_unit: of its positions, "" for the unit it states; shadows: cameras render them.
        replay_speed: factor on the recorded speed; 0 means as fast as possible.
        seed: of the scene variation, None for none; variation: its extent.
        generate: episodes to write to a data set.
        examining: the file is being checked, so recordings are inspected; launching: the run starts, so
            rendering must be possible here. Neither is part of the plan.
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
    trajectory_unit: Annotated[str, FromField("trajectory_unit", lambda name: _UNITS.get(name, name))] = ""
    shadows: bool = True
    replay_speed: float
    episodes: tuple[int, ...] = ()
    seed: int | None = None
    variation: VariationSettings | None = None
    generate: DatasetSettings | None = None
    examining: Annotated[bool, Field(exclude=True)] = False
    launching: Annotated[bool, Field(exclude=True)] = False

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the folder of the configuration, and the data set that is replayed or generated."""
        result = super().si_values(values, node, context)
        result |= {"folder": context.folder, "examining": True}
        result["launching"] = context.launch
        folder = Path(result["folder"])
        result["renders"] = [
            render | {"output": str(folder / os.path.expanduser(render["output"]))}  # noqa: PTH111 (below)
            for render in result.get("renders", ())
        ]
        path, stored = result["trajectory_path"], context.data_store
        if made := result.get("generate"):
            known = {"task": stored.task, "robot_type": stored.robot_type, "writer": stored.writer}
            result["generate"] = made | known | {"folder": stored.path}
        if result.get("seed") is not None and result.get("variation") is None:
            result["variation"] = variation_defaults()
        if path:
            # an unknown user stays unexpanded
            result["trajectory_path"] = str(folder / os.path.expanduser(path))  # noqa: PTH111
        elif result["mode"] == "PASSIVE":
            result |= {"trajectory_path": stored.path, "episodes": stored.episodes}
        return result

    @model_validator(mode="after")
    def _check(self) -> SimulationSettings:
        facts = model_facts(self.model_path, self.folder, self.attached)
        if self.keyframe:
            known_name("keyframe", "keyframe", self.keyframe, facts.keyframes)
        for index, mapping in enumerate(self.mirror_topic_mappings):
            field = f"mirror_topic_mappings[{index}].mujoco_actuator"
            facts.known_actuator(field, mapping.mujoco_actuator)
        for index, render in enumerate(self.renders):
            known_name(f"renders[{index}].camera", "camera", render.camera, facts.cameras)
            check_output(index, render.output)
            check_frames(f"renders[{index}].fps", render.fps, facts.timestep_s)
        check_outputs([render.output for render in self.renders])
        self._check_variation()
        self._check_generated(facts)
        if self.launching and self.renders:
            require_pictures("renders[0].camera")
        if self.launching and self.generate is not None and self.generate.cameras:
            require_pictures("generate.cameras[0]")
        if self.examining and self.trajectory_path:
            check_recording(self.trajectory_path, self.episodes, self.trajectory_unit, facts)
        if self.renders and self.mode != "OFFSCREEN":
            raise FieldError(
                "renders",
                f"renders have an effect only with mode: OFFSCREEN, and the mode is {self.mode}",
                remedy="set mode: OFFSCREEN, or remove them",
            )
        return self

    def _check_variation(self) -> None:
        if self.variation is not None and self.seed is None:
            raise FieldError(
                "variation",
                "variation has no effect without a seed",
                remedy="add seed: 1, or remove variation",
            )

    def _check_generated(self, facts: ModelFacts) -> None:
        made = self.generate
        if self.trajectory_path and not (self.mode == "PASSIVE" or (self.mode == "OFFSCREEN" and made)):
            raise FieldError(
                "trajectory_path",
                f"a recording has no effect with mode: {self.mode}",
                remedy="set mode: PASSIVE to look at it, or OFFSCREEN with generate to make episodes of it",
            )
        if made is None:
            return
        if self.mode != "OFFSCREEN":
            raise FieldError(
                "generate",
                f"episodes are made only with mode: OFFSCREEN, and the mode is {self.mode}",
                remedy="set mode: OFFSCREEN, or remove generate",
            )
        for index, camera in enumerate(made.cameras):
            known_name(f"generate.cameras[{index}]", "camera", camera, facts.cameras)
        check_picture_keys(made.cameras)
        check_frames("generate.fps", made.fps, facts.timestep_s)
        for name, size in (("width", made.width), ("height", made.height)):
            if made.cameras and size % 2:
                raise FieldError(
                    f"generate.{name}",
                    f"a video needs an even width and height, and {name} is {size}",
                    allowed=(str(size - 1), str(size + 1)),
                    remedy=f"set {name}: {size + 1}",
                )
        if made.duration_s is None and not self.trajectory_path:
            raise FieldError(
                "generate",
                "the length of an episode is not defined: duration_s and trajectory_path are both missing",
                remedy="add duration_s: 8, or trajectory_path",
            )

    def world(self) -> WorldSettings:
        """Return the settings of the physics, equal for every node of the file."""
        from joshua_mujoco_sim.world import WorldSettings

        return WorldSettings(
            model_path=self.model_path,
            folder=self.folder,
            keyframe=self.keyframe,
            real_time_factor=self.real_time_factor,
            reset_on_divergence=self.on_divergence == "DIVERGENCE_RESET",
            attached=attachments(self.attached),
            shadows=self.shadows,
            variation=variation(self.seed, self.variation.model_dump() if self.variation else {}),
        )


class SimActuatorSettings(ActuatorSettings):
    """Settings of actuators of the model.

    Attributes:
        actuators: names of joints, or of their actuators or tendons, in joint order; never empty.
        drives: gains of position loops.
        facts: of the model, while the file is checked; not part of the plan.
        joint_ranges: name and limits of each joint in the model.
        calibration: None if the joints count from the model's zero.
        motion, motion_amplitude_rad, motion_frequency_hz, motion_file: motion with torque off.
        demonstrate: id of the demonstrator's task, "" for none; noise_rad: of its goals.
        recoveries: share of its episodes that show recoveries.
    """

    actuators: tuple[str, ...]
    motion: Annotated[
        Literal["none", "sine", "file"], FromField("motion", lambda name: _MOTIONS.get(name, name))
    ]
    motion_amplitude_rad: float
    motion_frequency_hz: float
    motion_file: str
    demonstrate: str = ""
    noise_rad: float = 0.0
    recoveries: float = 0.0
    drives: tuple[JointDrive, ...] = ()
    model_path: str = ""
    facts: Annotated[ModelFacts | None, Field(exclude=True)] = None
    joint_ranges: tuple[dict[str, Any], ...] = ()
    calibration: ArmCalibration | None = None

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Default to all actuators; add their joints and calibration."""
        result = super().si_values(values, node, context)
        if context.calibration is not None:
            result["calibration"] = ArmCalibration.values_of(context.calibration)
        simulation = context.simulation
        if not simulation:
            return result
        facts = facts_of(simulation)
        result["actuators"] = tuple(result.get("actuators") or facts.actuators)
        result["model_path"] = str(simulation.get("model_path") or "")
        result["facts"] = facts
        known = [facts.joints[name] for name in result["actuators"] if name in facts.joints]
        result["joint_ranges"] = [
            {
                "name": joint.name.rpartition("/")[2],
                "min_rad": joint.low,
                "max_rad": joint.high,
                "by_hand": joint.by_hand,
            }
            for joint in known
        ]
        return result

    @model_validator(mode="after")
    def _check(self) -> SimActuatorSettings:
        if self.facts is not None:
            check_joints(self.facts, self.actuators)
            check_drives(self.facts, self.actuators, self.drives)
        if self.demonstrate and self.model_path and self.model_path != _DEMONSTRATED[self.demonstrate]:
            raise FieldError(
                "demonstrate",
                f"{self.demonstrate} is a task in {_DEMONSTRATED[self.demonstrate]}, and the simulation is "
                f"{self.model_path}",
                remedy=f'set simulation {{ model_path: "{_DEMONSTRATED[self.demonstrate]}" }}',
            )
        if self.motion == "file" and not self.motion_file:
            raise FieldError(
                "motion_file",
                "motion is MOCK_MOTION_FILE, but motion_file is missing",
                remedy="name a CSV file in motion_file, or choose another motion",
            )
        return self

    @model_validator(mode="after")
    def _fits_its_calibration(self) -> SimActuatorSettings:
        if self.calibration is None or not self.joint_ranges:
            return self
        made_for = self.calibration.device_identity
        if made_for not in ("", IDENTITY):
            raise FieldError(
                "",
                f"the calibration is for {made_for}, but this arm is simulated",
                remedy="calibrate it with MODE_CALIBRATION, or leave the calibration out: "
                "without one its joints count from the model's zero",
            )
        problems = list(misfits(self.joint_ranges, self.calibration))
        absent = [
            f"{joint['name']} (id {index + 1}) is not calibrated"
            for index, joint in enumerate(self.joint_ranges)
            if joint["by_hand"] and self.calibration.motor(index + 1) is None
        ]
        if problems or absent:
            raise FieldError(
                "",
                f"the calibration does not fit the model: {'; '.join([*problems, *absent])}",
                remedy="calibrate it again with MODE_CALIBRATION, or include the calibration of this model",
            )
        return self

    def exclusive(self) -> dict[str, str]:
        """Return the joints of the model that these actuators drive, by the field with the name of each.

        A demonstrator only computes goals, for the joints of the arm that follows it.
        """
        if self.facts is None or self.demonstrate:
            return {}
        joints = self.facts.joints
        return {f"actuators[{index}]": joints[name].name for index, name in enumerate(self.actuators)}

    def frames(self) -> list[Frame]:
        """Joints about their zeros, known without a connection."""
        return frames(self.joint_ranges, self.calibration)

    def joints(self) -> tuple[JointRange, ...]:
        """Joints, known without a connection."""
        return tuple(JointRange(frame.name, frame.min_rad, frame.max_rad) for frame in self.frames())


class SimCameraSettings(BlockSettings):
    """Settings of a camera of the model: its name, size in pixels, frames per second of simulated time."""

    camera: str
    width: int
    height: int
    fps: int
    cameras: tuple[str, ...] = ()
    launching: Annotated[bool, Field(exclude=True)] = False

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the cameras of the model."""
        result = super().si_values(values, node, context)
        if simulation := context.simulation:
            result["cameras"] = facts_of(simulation).cameras
            result["launching"] = context.launch
        return result

    @model_validator(mode="after")
    def _check(self) -> SimCameraSettings:
        if self.cameras:  # known where the file has a simulation, which adds one to every model
            known_name("camera", "camera", self.camera, self.cameras)
        if self.launching:
            require_pictures("camera")
        return self
