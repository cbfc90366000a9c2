"""Episodes generated in OFFSCREEN mode and passed to a data set writer frame by frame."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from joshua.features import (
    ACTION,
    STATE,
    DatasetLayout,
    EpisodeError,
    EpisodeWriter,
    Feature,
    FeatureSet,
    Frame,
    camera_key,
)
from joshua.tools import load_target

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.opengl import RenderingError
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.settings_parts import DatasetSettings
from joshua_mujoco_sim.trajectories.trajectory import FloatArray, Trajectory
from joshua_mujoco_sim.world import World

#: Consecutive episodes that may be lost to a divergence or an external reset before giving up.
MOST_LOST = 5


class RecordedDrive:
    """Commands the joints of a recording, with linear interpolation.

    Args:
        physics: of the model; trajectory: the recording.

    Raises:
        TrajectoryError: it does not fit the model.
    """

    def __init__(self, physics: Physics, trajectory: Trajectory) -> None:
        everything = physics.group(())
        joints, self._position = trajectory.for_joints(everything.ranges_rad)
        chosen = [everything.joints.index(joint) for joint in joints]
        self.group: ActuatorGroup = physics.group([everything.names[index] for index in chosen])
        self._time_s = trajectory.time_s

    @property
    def first(self) -> FloatArray:
        """Return the start position."""
        first: FloatArray = self._position[0]
        return first

    def command(self, time_s: float) -> None:
        """Command the positions at a time of the recording; after its end, the last sample."""
        at = int(np.searchsorted(self._time_s, time_s, side="right"))
        if at in (0, len(self._time_s)):
            self.group.set_command(self._position[min(at, len(self._time_s) - 1)])
            return
        before, after = self._time_s[at - 1], self._time_s[at]
        part = (time_s - before) / (after - before)
        self.group.set_command(self._position[at - 1] * (1 - part) + self._position[at] * part)


class EpisodeMaker:
    """Generates episodes, each from a new start of the scene. The physics waits for each frame.

    Args:
        world: what is recorded; settings: how many, how long, and where they go.
        recordings: that drive the joints, in turn; () leaves driving to the nodes of the file.
        log: receives a line for each episode.

    Raises:
        EpisodeError: the data set cannot be made; TrajectoryError: a recording does not fit the model.

    Attributes:
        error: why it gave up; "" otherwise.
    """

    def __init__(
        self,
        world: World,
        settings: DatasetSettings,
        recordings: Sequence[Trajectory],
        log: logging.Logger | Any,
    ) -> None:
        physics = world.physics
        self._world, self._settings, self._log = world, settings, log
        self._group = physics.group(())
        self._drives = [RecordedDrive(physics, recording) for recording in recordings]
        lengths = [settings.duration_s or recording.duration_s for recording in recordings]
        self._frames = [max(1, round(s * settings.fps)) for s in lengths or [settings.duration_s or 0.0]]
        self._keys = {camera: camera_key(camera) for camera in settings.cameras}
        joints = self._group.joints
        unit = "rad" if set(self._group.units) == {"rad"} else ""  # slides are in metres
        self._writer: EpisodeWriter = load_target(settings.writer)(
            DatasetLayout(
                folder=Path(settings.folder),
                robot_type=settings.robot_type,
                fps=settings.fps,
                features=FeatureSet(
                    [
                        Feature.joints(STATE, joints, unit=unit),
                        Feature.joints(ACTION, joints, unit=unit),
                        *(Feature.picture(k, settings.height, settings.width) for k in self._keys.values()),
                    ]
                ),
            )
        )
        self._writer.open()
        self._renderers: dict[str, CameraRenderer] = {}
        self._pending: dict[str, Any] | None = None
        self._frame = self._lost = 0
        self._last_s = 0.0
        self._closed = False
        self.error = ""
        self._hooks: list[Callable[[], None]] = []

    @property
    def written(self) -> int:
        """Number of written episodes."""
        return self._writer.episodes

    @property
    def wanted(self) -> int:
        """Number of requested episodes."""
        return self._settings.count

    @property
    def done(self) -> bool:
        """Whether every episode is written."""
        return self.written >= self.wanted

    def begin(self) -> None:
        """Start the first episode after ``open``. The caller holds the world's lock."""
        self._hooks = [self._world.before_step(self._look), self._world.after_step(self._keep)]
        self._start(0)

    def close(self) -> None:
        """Discard an unfinished episode, after the physics has stopped."""
        for unhook in self._hooks:
            unhook()
        self._hooks = []
        self._closed = True
        self._writer.close()

    def report(self) -> str:
        """Return the result in one sentence."""
        return f"{self._writer.episodes} of {self._settings.count} episodes in {self._settings.folder}"

    @property
    def _drive(self) -> RecordedDrive | None:
        return self._drives[self._writer.episodes % len(self._drives)] if self._drives else None

    def _start(self, start: int | None) -> None:
        physics, drive = self._world.physics, self._drive
        if drive is not None:
            physics.begin_at(drive.group, drive.first)
        physics.reset(start)
        self._frame, self._last_s, self._pending = 0, 0.0, None

    def _look(self, physics: Physics) -> None:
        """Drive the joints, and capture a frame if one is due (before each step)."""
        if self.done or self.error:
            return
        try:
            if physics.time_s < self._last_s:
                self._lose(physics)
            self._last_s = physics.time_s
            if (drive := self._drive) is not None:
                drive.command(physics.time_s)
            if physics.time_s >= self._frame / self._settings.fps - 1e-9:
                self._pending = {STATE: self._group.position_rad}
                for renderer in self._renderers.values():
                    renderer.look(physics.data)
        except (EpisodeError, RenderingError) as error:
            self.error = str(error)

    def _keep(self, physics: Physics) -> None:
        """Add the commands of its step to the frame (after each step)."""
        if self._pending is None or self.error:
            return
        frame, self._pending = self._pending | {ACTION: self._group.command}, None
        stamp_ns = round((physics.time_s - physics.timestep_s) * 1e9)
        self._world.defer(lambda: self._write(stamp_ns, frame))

    def _write(self, stamp_ns: int, frame: dict[str, Any]) -> None:
        """Draw a frame and write it, while the physics waits (without the lock)."""
        if self.error or self._closed or self._world.physics.time_s < self._last_s:
            return  # a frame of a diverged step ends no episode
        try:
            pictures = {self._keys[camera]: drawn.draw() for camera, drawn in self._renderers.items()}
            self._writer.add_frame(Frame(stamp_ns, frame | pictures))
            self._frame += 1
            number = self._writer.episodes
            if self._frame >= self._frames[number % len(self._frames)]:
                self._writer.end_episode(self._settings.task)
                self._lost = 0
                self._log.info("episode %d of %d is written", number + 1, self._settings.count)
                if self.done:
                    self._free()
                else:
                    with self._world.lock:
                        self._start(None)
        except (EpisodeError, RenderingError) as error:
            self.error = str(error)

    def _lose(self, physics: Physics) -> None:
        """Discard an episode after an external reset or a divergence."""
        self._writer.drop_episode()
        self._lost += 1
        if self._lost > MOST_LOST:
            raise EpisodeError(
                f"{MOST_LOST + 1} episodes in a row were cut off by a reset or a divergence: correct the "
                "model or the motion; the episodes before them are kept"
            )
        self._log.warning("episode %d was interrupted, and is made again", self._writer.episodes + 1)
        self._start(None)

    def open(self) -> None:
        """Create the renderers on the physics thread, because OpenGL binds them to it."""
        settings, model = self._settings, self._world.physics.model
        try:
            for camera in settings.cameras:
                self._renderers[camera] = CameraRenderer(
                    model, camera, settings.width, settings.height, shadows=self._world.settings.shadows
                )
        except RenderingError as error:
            self.error = str(error)

    def _free(self) -> None:
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers = {}
