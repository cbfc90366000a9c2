"""Commands from messages: matched to the joints by name, refused if invalid."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.devices.actuator import FloatArray
from joshua.plan.joints import JointRange

#: Number of refusal causes that are counted separately. Further ones are counted together.
MOST_CAUSES = 100

#: Refusals of one cause are logged at the first, then at each power of ten.
_LOGGED_COUNTS = frozenset(10**power for power in range(12))


@dataclass(frozen=True)
class MappedJoint:
    """A pair of joints. The leader's range is mapped to the follower's range."""

    leader: str
    follower: str
    leader_min_rad: float
    leader_max_rad: float
    follower_min_rad: float
    follower_max_rad: float

    def position_rad(self, leader_rad: float) -> float:
        """The follower's position for one of the leader's; beyond the leader's range it stays at the end."""
        fraction = (leader_rad - self.leader_min_rad) / (self.leader_max_rad - self.leader_min_rad)
        # keeps NaN, which is refused later
        fraction = 0.0 if fraction < 0.0 else 1.0 if fraction > 1.0 else fraction
        return self.follower_min_rad + fraction * (self.follower_max_rad - self.follower_min_rad)


class LeaderMapping:
    """Maps the joint positions of a leader to those of a follower.

    Joints are paired by name; the others are paired in order.

    Args:
        leader_joints, follower_joints: in joint order.

    Raises:
        ValueError: a joint has no range, or there is no pair. The message names the joint.
    """

    def __init__(self, leader_joints: Sequence[JointRange], follower_joints: Sequence[JointRange]) -> None:
        leaders = {joint.name: joint for joint in leader_joints}
        followers = {joint.name: joint for joint in follower_joints}
        names = [(name, name) for name in followers if name in leaders]
        names += zip(
            [name for name in leaders if name not in followers],
            [name for name in followers if name not in leaders],
            strict=False,  # surplus joints of one arm stay where they are
        )
        if not names:
            raise ValueError("leader and follower have no joint in common: check the calibration of both")
        self.pairs = tuple(_pair(leaders[leader], followers[follower]) for leader, follower in names)
        self._by_leader = {pair.leader: pair for pair in self.pairs}
        self.unpaired_leader = tuple(name for name in leaders if name not in self._by_leader)
        paired = {pair.follower for pair in self.pairs}
        self.unpaired_follower = tuple(name for name in followers if name not in paired)

    def pair(self, leader_joint: str) -> MappedJoint | None:
        """The pair of a leader's joint; None if it has no partner or is unknown."""
        return self._by_leader.get(leader_joint)


def _pair(leader: JointRange, follower: JointRange) -> MappedJoint:
    for role, joint in (("leader", leader), ("follower", follower)):
        if not joint.min_rad < joint.max_rad:
            raise ValueError(
                f"joint {joint.name} of the {role} has no range: {joint.min_rad} to {joint.max_rad} rad; "
                "calibrate it, or set position_min below position_max"
            )
    return MappedJoint(
        leader.name, follower.name, leader.min_rad, leader.max_rad, follower.min_rad, follower.max_rad
    )


@dataclass(frozen=True)
class JointCommand:
    """Positions for some of the joints.

    Attributes:
        indices: of the joints, shape (M,).
        position_rad: shape (M,).
    """

    indices: npt.NDArray[np.intp]
    position_rad: FloatArray


@dataclass(frozen=True)
class TrajectoryCommand:
    """Positions over time for some of the joints, linear between the points.

    Attributes:
        indices: of the joints, shape (M,).
        time_s: times of the points after the start, increasing, shape (K,), K ≥ 0.
        position_rad: shape (K, M).
    """

    indices: npt.NDArray[np.intp]
    time_s: FloatArray
    position_rad: FloatArray

    def at(self, elapsed_s: float, start_rad: FloatArray) -> FloatArray:
        """Positions at a time after the start, shape (M,), from ``start_rad`` at 0 on."""
        times = np.concatenate(([0.0], self.time_s)) if self.time_s[0] > 0 else self.time_s
        points = np.vstack((start_rad, self.position_rad)) if self.time_s[0] > 0 else self.position_rad
        return np.array([np.interp(elapsed_s, times, column) for column in points.T])

    @property
    def duration_s(self) -> float:
        """Time of the last point; 0 without points."""
        return float(self.time_s[-1]) if len(self.time_s) else 0.0


class CommandError(ValueError):
    """A command is invalid and refused. The message says why."""


class CommandReader:
    """Turns the messages of one topic into commands for one group of joints.

    Args:
        topic: name, for messages.
        joint_names: in joint order.
        log: where refusals and unknown names are reported.
        mappings: from the joints of leaders to these, by the name of the leader's node. Every other publisher
            sends radians of these joints.
    """

    def __init__(
        self,
        topic: str,
        joint_names: Sequence[str],
        log: Any,
        mappings: Mapping[str, LeaderMapping] | None = None,
    ) -> None:
        self.topic = topic
        self.accepted = 0
        self.refused = 0
        self._indices = {name: index for index, name in enumerate(joint_names)}
        self._causes: Counter[str] = Counter()
        self._log = log
        self._mappings = mappings or {}
        self._unknown: set[str] = set()
        self._routes: dict[LeaderMapping | None, tuple[tuple[str, ...], _Route]] = {}

    def joint_state(self, message: Any, publisher: str = "") -> JointCommand | None:
        """Reads a JointState of a node; None if it is refused."""
        try:
            positions = np.asarray(message.position, np.float64)
            if positions.shape != (len(message.name),):
                raise CommandError(f"{len(message.name)} names and {positions.size} positions")
            route = self._route(tuple(message.name), publisher)
            command = JointCommand(route.indices, route.values(positions[None, :])[0])
        except CommandError as error:
            self._refuse(error)
            return None
        self.accepted += 1
        return command

    def trajectory(self, message: Any, publisher: str = "") -> TrajectoryCommand | None:
        """Reads a JointTrajectory of a node; None if it is refused.

        One without points stops the joints. It starts on arrival: the time of its header, and velocities and
        accelerations, are ignored.
        """
        try:
            command = self._trajectory(message, publisher)
        except CommandError as error:
            self._refuse(error)
            return None
        self.accepted += 1
        return command

    def _trajectory(self, message: Any, publisher: str) -> TrajectoryCommand:
        names, points = tuple(message.joint_names), list(message.points)
        if not points:
            return TrajectoryCommand(np.zeros(0, np.intp), np.zeros(0), np.zeros((0, 0)))
        times = np.array([p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in points])
        if (np.diff(times, prepend=-1.0) <= 0).any() or times[0] < 0:
            raise CommandError("time_from_start is negative, or does not increase from point to point")
        for number, point in enumerate(points):
            if len(point.positions) != len(names):
                raise CommandError(
                    f"{len(names)} names and {len(point.positions)} positions in point {number}"
                )
        positions = np.array([point.positions for point in points], np.float64)
        route = self._route(names, publisher)
        return TrajectoryCommand(route.indices, times, route.values(positions))

    def _route(self, names: tuple[str, ...], publisher: str) -> _Route:
        """The assignment of a message's positions to joints, cached because names rarely change."""
        mapping = self._mappings.get(publisher)
        known = self._routes.get(mapping)
        if known is None or known[0] != names:
            known = self._routes[mapping] = (names, self._make_route(names, mapping))
        return known[1]

    def _make_route(self, names: tuple[str, ...], mapping: LeaderMapping | None) -> _Route:
        pairs = [mapping.pair(name) if mapping else None for name in names]
        joints = [pair.follower if pair else name for pair, name in zip(pairs, names, strict=True)]
        if len(set(joints)) != len(joints):
            raise CommandError("a joint is named twice")
        columns = [column for column, name in enumerate(joints) if name in self._indices]
        unpaired = mapping.unpaired_leader if mapping else ()
        self._warn_unknown([name for name in joints if name not in self._indices and name not in unpaired])
        if not columns:
            raise CommandError(
                f"it names no known joint: it names {_list(names)}, the joints are {_list(self._indices)}"
            )
        return _Route(
            tuple(columns),
            np.array([self._indices[joints[column]] for column in columns], np.intp),
            tuple(pairs[column] for column in columns),
            tuple(names[column] for column in columns),
        )

    def _warn_unknown(self, names: list[str]) -> None:
        new = [name for name in names if name not in self._unknown]
        if new and len(self._unknown) < 1000:  # names come from outside: what is remembered is bounded
            self._unknown.update(new)
            self._log.warning(
                "%s: the unknown joints %s are ignored; the joints are %s",
                self.topic,
                _list(new),
                _list(self._indices),
            )

    def _refuse(self, error: CommandError) -> None:
        self.refused += 1
        cause = str(error)
        if cause in self._causes or len(self._causes) < MOST_CAUSES:  # they come from outside
            self._causes[cause] += 1
            if self._causes[cause] not in _LOGGED_COUNTS:
                return
        elif self.refused not in _LOGGED_COUNTS:
            return
        self._log.warning("%s: command refused (%d so far): %s", self.topic, self.refused, error)


@dataclass(frozen=True)
class _Route:
    """The assignment of a message's columns to joints, through the pairs of a leader, if any."""

    columns: tuple[int, ...]
    indices: npt.NDArray[np.intp]
    pairs: tuple[MappedJoint | None, ...]
    names: tuple[str, ...]

    def values(self, positions: FloatArray) -> FloatArray:
        """Positions of the joints, shape (K, M), from those of the message, shape (K, number of names)."""
        return np.array([self._row(row) for row in positions.tolist()])

    def _row(self, row: list[float]) -> list[float]:
        """In plain Python, which is faster for few joints."""
        values = []
        for column, pair, name in zip(self.columns, self.pairs, self.names, strict=True):
            value = row[column]
            if not math.isfinite(value):
                raise CommandError(f"the position of {_list([name])} is {value}")
            values.append(pair.position_rad(value) if pair is not None else value)
        return values


def _list(names: Iterable[str]) -> str:
    """Names for a message. They come from outside, so their length and number are bounded."""
    shown = [repr(name if len(name) <= 64 else name[:64] + "…") for name in islice(names, 10)]
    return ", ".join(shown) or "nothing"
