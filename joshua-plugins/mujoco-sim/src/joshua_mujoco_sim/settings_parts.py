"""Parts of the simulation settings: topic mappings, files, and variation by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.api import FieldError
from joshua.features import camera_key
from pydantic import BaseModel, ConfigDict

from joshua_mujoco_sim.opengl import RenderingError, choose_gl

if TYPE_CHECKING:
    from joshua_mujoco_sim.model_facts import ModelFacts
    from joshua_mujoco_sim.variation import Variation

#: Recordings up to this size are read while a file is checked.
LARGEST_CHECKED_BYTES = 20_000_000


class TopicMapping(BaseModel):
    """One actuator that follows a topic: position · scale + offset."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    ros_topic: str
    mujoco_actuator: str
    offset: float
    scale: float
    joint: str


class Render(BaseModel):
    """Pictures of one camera to write to files; ``output`` is absolute."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    camera: str
    width: int
    height: int
    fps: int
    output: str


class DatasetSettings(BaseModel):
    """Episodes that OFFSCREEN writes to a data set.

    Attributes:
        count: number of episodes; duration_s: of each, None for that of its recording; fps: frames per
            second.
        cameras, width, height: pictures of each frame.
        folder: of the data set, absolute; task, robot_type: what it shows.
        writer: import string of the ``EpisodeWriter``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    count: int
    duration_s: float | None
    fps: int
    cameras: tuple[str, ...]
    width: int
    height: int
    folder: str
    task: str
    robot_type: str
    writer: str


class VariationSettings(BaseModel):
    """Extent of the scene variation, see ``Variation``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    joint_rad: float
    object_m: float
    light: float
    camera_m: float
    camera_rad: float


def check_picture_keys(cameras: Sequence[str]) -> None:
    """Check that no two cameras write to the same file. Raises FieldError."""
    keys = [camera_key(camera) for camera in cameras]
    for index, (camera, key) in enumerate(zip(cameras, keys, strict=True)):
        other = cameras[keys.index(key)]
        if keys.index(key) < index:
            both = f"{other} and {camera} would both be stored as {key}"
            raise FieldError(
                f"generate.cameras[{index}]",
                f"{camera} is listed twice" if camera == other else both,
                remedy="remove one of the two" if camera == other else "rename one of them in the model",
            )


def check_frames(field: str, fps: int, timestep_s: float) -> None:
    """Check that the frame rate does not exceed the step rate. Raises FieldError."""
    most = int(1 / timestep_s + 1e-6)
    if fps > most:
        raise FieldError(
            field,
            f"the model makes {most} steps per second and has no {fps} different frames in one",
            allowed=(f"1 to {most}",),
            remedy=f"set fps: {most} or less, or lower the time step of the model",
        )


def check_outputs(outputs: Sequence[str]) -> None:
    """Check that no two renders write to the same file. Raises FieldError."""
    for index, output in enumerate(outputs):
        if output in outputs[:index]:
            raise FieldError(
                f"renders[{index}].output",
                f"renders[{outputs.index(output)}] already writes {Path(output).name}",
                remedy="give each its own file",
            )


def check_output(index: int, output: str) -> None:
    """Check that a writer supports the file name. Raises FieldError."""
    field, path = f"renders[{index}].output", Path(output)
    if path.suffix == ".png":
        try:
            numbered = (path.name % 1) != (path.name % 2)
        except (TypeError, ValueError):
            numbered = False
        if not numbered:
            raise FieldError(
                field,
                f"{path.name} is a single file, but each picture needs its own",
                allowed=(f"{path.stem}_%05d.png",),
                remedy="put the number of the picture into the name, such as %05d",
            )
    elif path.suffix != ".mp4":
        raise FieldError(
            field,
            f"{path.suffix or 'no ending'} is not a supported picture format",
            allowed=(".mp4", "_%05d.png"),
            remedy="name a .mp4 file, or PNG files by a pattern",
        )


def require_pictures(field: str) -> None:
    """Check that OpenGL works on this machine if the run renders. Raises FieldError."""
    try:
        choose_gl()
    except RenderingError as error:
        raise FieldError(field, error.problem, remedy=error.remedy, code="machine-unfit") from error


def check_recording(path: str, episodes: Sequence[int], unit: str, facts: ModelFacts) -> None:
    """Check that a recording can be read and fits the model.

    A recording that is missing, large, or needs an extra is checked at the start of the run. Raises
    FieldError.
    """
    from joshua_mujoco_sim.trajectories.reading import read_trajectories, size_bytes
    from joshua_mujoco_sim.trajectories.trajectory import MissingExtraError, TrajectoryError

    place = Path(path)
    if not place.exists() or size_bytes(place) > LARGEST_CHECKED_BYTES:
        return
    joints = [facts.joints[name] for name in facts.actuators]
    ranges = {joint.name: (joint.low, joint.high) for joint in joints}
    try:
        for recording in read_trajectories(place, episodes, unit):
            recording.for_joints(ranges)
    except MissingExtraError:
        return
    except TrajectoryError as error:
        raise FieldError(
            "trajectory_path", str(error), remedy="correct the recording, or name another one"
        ) from error


def variation_defaults() -> dict[str, float]:
    """Return the default extent of the variation."""
    from joshua.api.schema import default_values, simulation_pb2

    return default_values(simulation_pb2.SceneVariation.DESCRIPTOR)


def variation(seed: int | None, amounts: Mapping[str, float]) -> Variation | None:
    """Return the variation of a scene; None without a seed."""
    from joshua_mujoco_sim.variation import Variation

    return None if seed is None else Variation(seed=seed, **amounts)
