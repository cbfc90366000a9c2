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

from joshua.devices.actuator import FloatArray, JointLimits
from joshua.plan.joints import JointRange

#: Number of refusal causes that are counted separately. Further ones are counted together.
MOST_CAUSES = 100

#: Distance beyond a limit up to which a command is not reported: rounding, and the noise of a model.
LIMIT_TOLERANCE_RAD = 0.01

#: The same for a leader: a person can push a joint a little further than at its calibration.
LEADER_TOLERANCE_RAD = 0.1

#: Number of pairs of commander and joint whose positions outside the limits are reported.
MOST_REPORTED = 1000

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
        log: where refusals, unknown names and positions outside the limits are reported.
        mappings: from the joints of leaders to these, by the name of the leader's node. Every other publisher
            sends radians of these joints.
        limits: to which positions are clipped; None for no limits.
    """

    def __init__(
        self,
        topic: str,
        joint_names: Sequence[str],
        log: Any,
        mappings: Mapping[str, LeaderMapping] | None = None,
        limits: JointLimits | None = None,
    ) -> None:
        self.topic = topic
        self.accepted = 0
        self.refused = 0
        self._indices = {name: index for index, name in enumerate(joint_names)}
        self._causes: Counter[str] = Counter()
        self._log = log
        self._mappings = mappings or {}
        unlimited = np.full(len(joint_names), np.inf)
        self._min_rad = -unlimited if limits is None else limits.position_min_rad
        self._max_rad = unlimited if limits is None else limits.position_max_rad
        self._unknown: set[str] = set()
        self._reported: set[tuple[str, str]] = set()
        self._routes: dict[LeaderMapping | None, tuple[tuple[str, ...], _Route]] = {}

    def joint_state(self, message: Any, publisher: str = "") -> JointCommand | None:
        """Reads a JointState of a node; None if it is refused."""
        try:
            positions = np.asarray(message.position, np.float64)
            if positions.shape != (len(message.name),):
                raise CommandError(f"{len(message.name)} names and {positions.size} positions")
            route = self._route(tuple(message.name), publisher)
            position_rad = self._positions(route, positions[None, :], publisher)[0]
            command = JointCommand(route.indices, position_rad)
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
        return TrajectoryCommand(route.indices, times, self._positions(route, positions, publisher))

    def _positions(self, route: _Route, positions: FloatArray, publisher: str) -> FloatArray:
        """Positions within the limits, shape (K, M), from those of the message, shape (K, number of names).

        Raises CommandError for a position that is not finite.
        """
        rows = positions.tolist()
        values = [route.values(row) for row in rows]
        for row in rows:
            for column in route.columns:
                if not column.report_below_rad <= row[column.number] <= column.report_above_rad:
                    self._report_outside(column, row[column.number], publisher)
        return np.array(values)

    def _report_outside(self, column: _Column, value_rad: float, publisher: str) -> None:
        """Warns of the first position of a joint that lies outside its limits, once for each commander."""
        key = (publisher, column.name)
        if key in self._reported or len(self._reported) >= MOST_REPORTED:
            return
        self._reported.add(key)
        pair = column.pair
        if pair is None:
            self._log.warning(
                "%s: %s commands %s to %.4g rad, its limits are %.4g to %.4g rad: the joint stays within its "
                "limits. Further such commands are not logged",
                self.topic,
                shown_publisher(publisher),
                column.name,
                value_rad,
                self._min_rad[column.index],
                self._max_rad[column.index],
            )
            return
        self._log.warning(
            "%s: the leader %s reports %s at %.4g rad, its range is %.4g to %.4g rad: %s stays at the end of "
            "its own range. Calibrate the leader again, or widen its position_min and position_max",
            self.topic,
            shown_publisher(publisher),
            column.name,
            value_rad,
            pair.leader_min_rad,
            pair.leader_max_rad,
            pair.follower,
        )

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
        columns = [
            self._column(number, name, joint, pair)
            for number, (name, joint, pair) in enumerate(zip(names, joints, pairs, strict=True))
            if joint in self._indices
        ]
        unpaired = mapping.unpaired_leader if mapping else ()
        self._warn_unknown([name for name in joints if name not in self._indices and name not in unpaired])
        if not columns:
            raise CommandError(
                f"it names no known joint: it names {_list(names)}, the joints are {_list(self._indices)}"
            )
        return _Route(tuple(columns), np.array([column.index for column in columns], np.intp))

    def _column(self, number: int, name: str, joint: str, pair: MappedJoint | None) -> _Column:
        index = self._indices[joint]
        min_rad, max_rad = float(self._min_rad[index]), float(self._max_rad[index])
        if pair is not None:
            below_rad = pair.leader_min_rad - LEADER_TOLERANCE_RAD
            above_rad = pair.leader_max_rad + LEADER_TOLERANCE_RAD
        else:
            below_rad, above_rad = min_rad - LIMIT_TOLERANCE_RAD, max_rad + LIMIT_TOLERANCE_RAD
        return _Column(number, name, index, pair, min_rad, max_rad, below_rad, above_rad)

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
class _Column:
    """One position of a message that moves a joint.

    Attributes:
        number: in the message; name: of the joint there; index: of the joint here; pair: of a leader's joint.
        min_rad, max_rad: limits of the joint here.
        report_below_rad, report_above_rad: positions in the message beyond these are reported.
    """

    number: int
    name: str
    index: int
    pair: MappedJoint | None
    min_rad: float
    max_rad: float
    report_below_rad: float
    report_above_rad: float


@dataclass(frozen=True)
class _Route:
    """The assignment of a message's columns to joints.

    Attributes:
        columns: those that move a joint, M of them; indices: of their joints, shape (M,).
    """

    columns: tuple[_Column, ...]
    indices: npt.NDArray[np.intp]

    def values(self, row: list[float]) -> list[float]:
        """Positions of the joints within their limits, in plain Python: faster for few joints."""
        values = []
        for column in self.columns:
            value = row[column.number]
            if not math.isfinite(value):
                raise CommandError(f"the position of {_list([column.name])} is {value}")
            if column.pair is not None:
                value = column.pair.position_rad(value)
            values.append(min(max(value, column.min_rad), column.max_rad))
        return values


def shown_publisher(publisher: str | None) -> str:
    """The name of a publisher for messages."""
    return publisher or "a program that is not a ROS 2 node"


def _list(names: Iterable[str]) -> str:
    """Names for a message. They come from outside, so their length and number are bounded."""
    shown = [repr(name if len(name) <= 64 else name[:64] + "…") for name in islice(names, 10)]
    return ", ".join(shown) or "nothing"
