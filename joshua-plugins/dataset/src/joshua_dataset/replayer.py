"""Replay recorded actions on a robot: the actuators follow them with their own ramp, limits and guardian."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.api import NodeContext, RefusedError, verb
from joshua.api.nodes import MessagePublisher, ServiceFacts
from joshua.features import ACTION, EpisodeError, Feature, JointUnits, Unit
from joshua.messages import MessageError
from joshua.messages.arrays import array_of
from joshua.messages.make import joint_state

from joshua_dataset.metadata import STAMP
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.settings import StoreSettings
from joshua_dataset.tracking import Tracking

#: Distance to the first action at which the approach ends, rad; and the longest approach, s.
NEAR_RAD = 0.05
APPROACH_S = 20.0

#: Suffix of LeRobot's joint names.
SUFFIX = ".pos"


@dataclass
class _Arm:
    """One arm of the robot and of the data set."""

    action: str
    state_topic: str
    names: tuple[str, ...]
    units: JointUnits
    unit: Unit
    order: list[int]
    publisher: MessagePublisher
    measured_rad: Any = None

    def radians(self, values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """Convert actions of the data set, (N, D), to radians in the robot's order of joints."""
        return self.units.to_radians(values[:, self.order], self.unit)


@dataclass
class _Track:
    """One episode under replay: times in seconds from its start, and the goals of each arm."""

    number: int
    time_s: npt.NDArray[np.float64]
    goals_rad: dict[str, npt.NDArray[np.float64]]


class Replayer:
    """Behaviour of ``DATA_STORE_REPLAY``.

    Args:
        context: of the node; settings: of the block; facts: observations and actions of the robot.
    """

    def __init__(self, context: NodeContext, settings: StoreSettings, facts: ServiceFacts) -> None:
        self._context, self._settings, self._facts = context, settings, facts
        self._arms: list[_Arm] = []
        self._tracks: list[_Track] = []
        self._began_s: float | None = None
        self._asked_s = 0.0
        self._paused = False
        self._index = 0
        self._tracking: dict[str, Tracking] = {}

    def configure(self) -> None:
        """Read the episodes and compare them with the robot. Raises EpisodeError."""
        folder = Path(self._settings.folder)
        try:
            dataset = Dataset.read(folder)
            self._arms = [self._arm(dataset, key) for key in self._facts.commands]
            if not self._arms:
                raise EpisodeError(
                    "no actuator of the file takes commands from a topic: nothing can be replayed"
                )
            self._tracks = self._read(dataset)
        except DatasetError as error:
            raise EpisodeError(f"{folder} cannot be replayed: {error}") from error
        self._warn_of_calibration(dataset)
        for topic in self._context.spec.subscriptions:
            for arm in self._arms:
                if topic.name == arm.state_topic:
                    self._context.subscribe(topic, self._measure(arm))

    def activate(self) -> None:
        """Start publishing."""
        steps_s = np.diff(self._tracks[0].time_s)
        period_s = float(np.median(steps_s)) if len(steps_s) else 0.02
        rate_hz = max(50.0, self._settings.speed / max(1e-3, period_s))
        self._asked_s = time.monotonic()
        self._context.create_timer(1 / min(rate_hz, 200.0), self._tick, name="replay")

    def deactivate(self) -> None:
        """Stop publishing; the actuators hold by their own watchdog."""
        self._tracks = []

    def cleanup(self) -> None:
        """Do nothing: nothing is open."""

    @verb(moves=False)
    def pause(self) -> str:
        """Stop sending commands; the arms hold."""
        if self._paused:
            raise RefusedError("the replay is already paused")
        self._paused, self._began_s = True, None
        return "the replay is paused"

    @verb(moves=True)
    def resume(self) -> str:
        """Approach the episode's start again and replay it."""
        if not self._paused:
            raise RefusedError("the replay is not paused")
        self._paused, self._asked_s = False, time.monotonic()
        return "the replay restarts its episode"

    def _arm(self, dataset: Dataset, key: str) -> _Arm:
        """Return how to command one arm of the robot. Raises EpisodeError."""
        there = dataset.features.get(key)
        if there is None and len(self._facts.commands) == 1:
            there = dataset.features.get("action")
        if there is None:
            raise EpisodeError(f"{dataset.folder} has no {key}; it has {', '.join(dataset.features)}")
        joints = self._facts.arms[key]
        names = tuple(joint.name for joint in joints)
        topic = self._facts.commands[key]
        publisher = next(item for item in self._context.spec.publishers if item.name == topic)
        try:
            unit = Unit(there.unit or "rad")
        except ValueError as error:
            raise EpisodeError(f"{key} is in {there.unit!r}, which is not a unit of joints") from error
        return _Arm(
            action=there.key,
            state_topic=next(
                (
                    f.topic
                    for f in self._facts.features
                    if f.key == key.replace("action", "observation.state", 1)
                ),
                "",
            ),
            names=names,
            units=JointUnits.from_ranges(joints),
            unit=unit,
            order=_order(there, names, dataset.folder),
            publisher=self._context.publisher(publisher),
        )

    def _read(self, dataset: Dataset) -> list[_Track]:
        wanted = set(self._settings.episodes)
        beyond = sorted(number for number in wanted if number >= dataset.episodes)
        if beyond:
            raise EpisodeError(
                f"{dataset.folder} has no episode {beyond[0]}; allowed: 0 to {dataset.episodes - 1}"
            )
        found: dict[int, _Track] = {}
        for episode in dataset.episode_list(wanted or None):
            columns = dataset.columns(episode)
            if STAMP in columns:
                time_s = (columns[STAMP] - columns[STAMP][0]) / 1e9
            else:
                time_s = np.asarray(columns["timestamp"], np.float64) - float(columns["timestamp"][0])
            goals = {arm.action: arm.radians(columns[arm.action]) for arm in self._arms}
            bad = [key for key, values in goals.items() if not np.isfinite(values).all()]
            if bad or np.any(np.diff(time_s) < 0):
                what = f"{bad[0]} is not finite" if bad else "its times run backwards"
                raise EpisodeError(f"episode {episode.index} of {dataset.folder} cannot be replayed: {what}")
            found[episode.index] = _Track(episode.index, time_s, goals)
        order = self._settings.episodes or sorted(found)
        if not order:
            raise EpisodeError(f"{dataset.folder} has no episode")
        return [found[number] for number in order]

    def _warn_of_calibration(self, dataset: Dataset) -> None:
        for key, joints in self._facts.arms.items():
            ours = " ".join(f"{joint.name}:{joint.min_rad:.4f}:{joint.max_rad:.4f}" for joint in joints)
            theirs = dataset.identity.get(f"calibration of {key}")
            if key.startswith("action") and theirs is not None and theirs != ours:
                self._context.warn(
                    f"{dataset.folder} was recorded with a different calibration of {key}: poses can differ. "
                    "Compare the calibrations before you replay at full speed"
                )

    def _measure(self, arm: _Arm) -> Any:
        def take(message: Any, received_ns: int) -> None:
            del received_ns
            try:
                arm.measured_rad = np.asarray(array_of(message, arm.names))
            except MessageError as error:
                self._context.warn(f"{arm.state_topic} is not compared: {error}")

        return take

    def _tick(self) -> None:
        if self._index >= len(self._tracks) or self._paused:
            return
        track = self._tracks[self._index]
        if self._began_s is None:
            self._approach(track)
            return
        elapsed_s = (time.monotonic() - self._began_s) * self._settings.speed
        at = int(np.searchsorted(track.time_s, elapsed_s, side="right")) - 1
        if at >= 0:
            self._command(track, at)
            for arm in self._arms:
                if arm.measured_rad is not None:
                    known = self._tracking.setdefault(arm.action, Tracking(arm.names))
                    known.add(elapsed_s, track.goals_rad[arm.action][at], arm.measured_rad)
        self._context.show(f"episode {track.number}, {elapsed_s:.1f} of {track.time_s[-1]:.1f} s")
        self._context.progress("replay", elapsed_s, float(track.time_s[-1]), unit="s")
        if elapsed_s > track.time_s[-1] + 0.2:
            self._report(track)
            self._index += 1
            self._began_s, self._asked_s, self._tracking = None, time.monotonic(), {}
            if self._index == len(self._tracks):
                self._context.end_run(f"{len(self._tracks)} episodes are replayed")

    def _approach(self, track: _Track) -> None:
        """Let the arms ramp to the first action, and start the replay when they reach it."""
        self._command(track, 0)
        self._context.show(f"approaching episode {track.number}")
        far = [
            arm
            for arm in self._arms
            if arm.measured_rad is None
            or float(np.max(np.abs(arm.measured_rad - track.goals_rad[arm.action][0]))) > NEAR_RAD
        ]
        waited_s = time.monotonic() - self._asked_s
        if not far:
            self._began_s = time.monotonic()
        elif waited_s > APPROACH_S:
            worst = far[0]
            if worst.measured_rad is None:
                self._context.fail(f"no joint states received on {worst.state_topic} within {APPROACH_S:g} s")
                return
            errors = np.abs(worst.measured_rad - track.goals_rad[worst.action][0])
            joint = worst.names[int(np.argmax(errors))]
            self._context.log.warning(
                "%s is %.2f rad away from the first action after %.0f s, which may lie beyond its limits; "
                "the replay begins",
                joint,
                float(errors.max()),
                waited_s,
            )
            self._began_s = time.monotonic()

    def _command(self, track: _Track, at: int) -> None:
        for arm in self._arms:
            goal = track.goals_rad[arm.action][at]
            arm.publisher.publish(joint_state(arm.names, goal, at_ns=self._context.now_ns()))

    def _report(self, track: _Track) -> None:
        """Log the tracking error of each joint, and draw it beside the data set."""
        folder = Path(self._settings.folder)
        for action, tracking in self._tracking.items():
            self._context.log.info("tracking error of episode %d, rad (mean, p95, largest):", track.number)
            for line in tracking.table():
                self._context.log.info("  %s", line)
            arm = action.removeprefix(ACTION).replace(".", "-")
            path = folder.with_name(f"{folder.name}-replay-{track.number}{arm}.svg")
            try:
                path.write_text(tracking.svg(f"{folder.name}, episode {track.number}{arm}"), encoding="utf-8")
            except OSError as error:
                self._context.warn(f"no picture of the replay: {path}: {error.strerror or error}")
            else:
                self._context.log.info("picture: %s", path)


def _order(feature: Feature, names: tuple[str, ...], folder: Path) -> list[int]:
    """Return the indices of the robot's joints in a feature. Raises EpisodeError."""
    plain = [name.removesuffix(SUFFIX) for name in feature.names]
    if set(names) <= set(plain):
        return [plain.index(name) for name in names]
    if feature.shape[0] == len(names) and not feature.names:
        return list(range(len(names)))
    raise EpisodeError(
        f"{folder}: {feature.key} has the joints {', '.join(plain) or 'without names'}, but the robot has "
        f"{', '.join(names)}"
    )
