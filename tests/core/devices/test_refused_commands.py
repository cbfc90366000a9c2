"""A refused command changes nothing, whatever is wrong with it and whoever sends it."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.devices import command_intake
from joshua.devices.actuator import JointLimits
from joshua.devices.command_intake import Commanders, CommandIntake
from joshua.devices.goal import GoalGenerator
from joshua.devices.joint_command import CommandReader, LeaderMapping
from joshua.messages import decode, encode, message_class
from joshua.messages.make import header
from joshua.plan import Commander, JointRange, NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from stepped_time import SteppedTime

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
LOG = logging.getLogger("test_refused_commands")
JOINTS = ("a", "b")
LIMIT_RAD = 2.0

#: Each kind of commander, by its name and topic: a leader with a mapping, a gamepad, a leader that overrides
#: by its motion, two programs outside the file, and a node that may not command.
PUBLISHERS = {
    "leader": ("/leader", "/command"),
    "override": ("/gamepad", "/command"),
    "override by motion": ("/guide", "/command"),
    "external": ("/moveit", "/free"),
    "another external": ("/talker", "/free"),
    "stranger": ("/stranger", "/command"),
}
PLAN = (
    Commander("/leader", "/command"),
    Commander("/gamepad", "/command", override=True),
    Commander("/guide", "/command", override=True, motion_rad=0.1),
)


@dataclass(frozen=True)
class Point:
    """One point of a trajectory."""

    time_s: float
    positions: tuple[float, ...]


def joint_state(names: tuple[str, ...], positions: tuple[float, ...]) -> Any:
    empty = np.zeros(0)
    message = message_class(JOINT_STATE)(header(), list(names), np.array(positions), empty, empty)
    return decode(JOINT_STATE, encode(message))


def trajectory(names: tuple[str, ...], points: tuple[Point, ...]) -> Any:
    duration = message_class("builtin_interfaces/msg/Duration")
    make = message_class("trajectory_msgs/msg/JointTrajectoryPoint")
    empty = np.zeros(0)
    listed = [
        make(
            np.array(point.positions),
            empty,
            empty,
            empty,
            duration(math.floor(point.time_s), round(point.time_s % 1 * 1e9)),
        )
        for point in points
    ]
    message = message_class(JOINT_TRAJECTORY)(header(), list(names), listed)
    return decode(JOINT_TRAJECTORY, encode(message))


class Arm:
    """The commands of two joints on a clock that the test sets."""

    def __init__(self, clock: SteppedTime) -> None:
        self.clock = clock
        limits = JointLimits(np.full(2, -LIMIT_RAD), np.full(2, LIMIT_RAD), np.full(2, 50.0))
        self.goals = GoalGenerator(limits, 0.02)
        self.goals.seed(np.zeros(2))
        self.commanders = Commanders(PLAN, ("/free",), self.goals, LOG)
        self.arrived: list[int] = []
        self.fault = ""
        spec = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="", implementation="")
        self.intake = CommandIntake(
            RecordingContext(spec), self.goals, self.commanders, self.arrived.append, lambda: self.fault
        )
        ranges = [JointRange(name, -LIMIT_RAD, LIMIT_RAD) for name in JOINTS]
        mappings = {"/leader": LeaderMapping(ranges, ranges)}
        self.readers = {topic: CommandReader(topic, JOINTS, LOG, mappings) for topic in ("/command", "/free")}

    def receive(self, publisher: str, message: Any) -> None:
        name, topic = PUBLISHERS[publisher]
        is_state = hasattr(message, "name")
        handle = self.intake.joint_state if is_state else self.intake.trajectory
        handle(self.readers[topic], message, name)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            self.clock.sleep(0.02)
            self.commanders.watch(self.clock.monotonic_ns())
            self.goals.step(self.clock.monotonic_ns())

    def state(self) -> dict[str, Any]:
        """Everything that decides about later commands and goals, except the counters of refusals."""
        ignored = {"_lock", "lock", "_log", "_goals", "refused", "limits"}
        values = {**vars(self.commanders), **vars(self.goals), "arrived": self.arrived}
        return {name: exact(value) for name, value in values.items() if name not in ignored}


def exact(value: Any) -> str:
    """A text that differs whenever a value differs."""
    with np.printoptions(floatmode="unique", threshold=10_000):
        return repr(value)


finite = st.floats(-LIMIT_RAD, LIMIT_RAD)
not_finite = st.sampled_from((math.nan, math.inf, -math.inf))
publishers = st.sampled_from(sorted(PUBLISHERS))
times_s = st.lists(st.integers(0, 300), min_size=1, max_size=3, unique=True).map(sorted)


@st.composite
def valid_messages(draw: st.DrawFn) -> Any:
    names = tuple(draw(st.permutations(JOINTS)))[: draw(st.integers(1, 2))]
    positions = st.lists(finite, min_size=len(names), max_size=len(names)).map(tuple)
    if draw(st.booleans()):
        return joint_state(names, draw(positions))
    return trajectory(names, tuple(Point(time / 100, draw(positions)) for time in draw(times_s)))


@st.composite
def invalid_positions(draw: st.DrawFn) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Names and positions that do not make a command."""
    fault = draw(st.sampled_from(("not finite", "too few", "too many", "unknown", "twice", "no names")))
    if fault == "not finite":
        wrong = draw(st.integers(0, 1))
        return JOINTS, tuple(draw(not_finite if index == wrong else finite) for index in range(2))
    if fault == "too few":
        return JOINTS, (draw(finite),) * draw(st.integers(0, 1))
    if fault == "too many":
        return JOINTS, (draw(finite),) * draw(st.integers(3, 5))
    if fault == "unknown":
        names = tuple(draw(st.lists(st.text(max_size=5).filter(lambda name: name not in JOINTS), min_size=1)))
        return names, (draw(finite),) * len(names)
    if fault == "twice":
        return ("a", "b", "a"), (draw(finite),) * 3
    return (), (draw(finite),) * draw(st.integers(1, 3))


@st.composite
def invalid_messages(draw: st.DrawFn) -> Any:
    if draw(st.booleans()):
        return joint_state(*draw(invalid_positions()))
    good = tuple(Point(time / 100, (draw(finite), draw(finite))) for time in draw(times_s))
    fault = draw(st.sampled_from(("positions", "order", "negative", "one point")))
    if fault == "positions":
        names, positions = draw(invalid_positions())
        return trajectory(names, tuple(Point(point.time_s, positions) for point in good))
    if fault == "order":
        return trajectory(
            JOINTS, (*good, Point(draw(st.integers(0, 100)) / 100 * good[-1].time_s, (0.0, 0.0)))
        )
    if fault == "negative":
        return trajectory(JOINTS, (Point(-draw(st.integers(1, 300)) / 100, (0.0, 0.0)), *good))
    wrong = draw(st.integers(0, len(good) - 1))
    bad = Point(good[wrong].time_s, (draw(finite), draw(not_finite)))
    return trajectory(JOINTS, (*good[:wrong], bad, *good[wrong + 1 :]))


#: What happens before the refused message: valid commands, release buttons and time that passes.
histories = st.lists(
    st.one_of(
        st.tuples(publishers, valid_messages()),
        st.tuples(st.sampled_from(("override", "override by motion")), st.just(joint_state((), ()))),
        st.tuples(st.just(""), st.integers(1, 60).map(lambda steps: 0.02 * steps)),
    ),
    max_size=8,
)


@given(history=histories, publisher=publishers, message=invalid_messages())
def test_a_refused_message_changes_nothing(
    history: list[tuple[str, Any]], publisher: str, message: Any
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        clock = SteppedTime()
        patch.setattr(command_intake, "time", clock)
        arm = Arm(clock)
        for sender, event in history:
            if sender:
                arm.receive(sender, event)
            else:
                arm.wait(event)
        before = arm.state()
        arm.receive(publisher, message)
        assert arm.state() == before


@given(history=histories, publisher=publishers, message=valid_messages())
def test_a_command_without_effect_changes_neither_commander_nor_goals(
    history: list[tuple[str, Any]], publisher: str, message: Any
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        clock = SteppedTime()
        patch.setattr(command_intake, "time", clock)
        arm = Arm(clock)
        for sender, event in history:
            if sender:
                arm.receive(sender, event)
            else:
                arm.wait(event)
        arm.fault = "torque is off"
        before = arm.state()
        arm.receive(publisher, message)
        # its commander still counts as publishing, and a leader's rest position is known
        irrelevant = {"ignored", "_until_ns", "_rest"}
        after = arm.state()
        assert {name for name in before if after[name] != before[name]} <= irrelevant


@pytest.mark.parametrize("publisher", sorted(set(PUBLISHERS) - {"stranger"}))
@pytest.mark.parametrize("message", [joint_state(("a",), (math.nan,)), trajectory(("x",), (Point(1, (0,)),))])
def test_each_refusal_of_a_commander_is_counted(publisher: str, message: Any) -> None:
    arm = Arm(SteppedTime())
    arm.receive(publisher, message)
    assert sum(reader.refused for reader in arm.readers.values()) == 1
    assert arm.commanders.current is None


def test_the_leader_keeps_the_arm_when_an_override_sends_nonsense(stepped_time: SteppedTime) -> None:
    arm = Arm(stepped_time)
    for _ in range(40):
        arm.receive("leader", joint_state(JOINTS, (0.01, 0.02)))
        arm.receive("override", joint_state(JOINTS, (math.nan, 0.0)))
        arm.wait(0.04)
    assert (arm.commanders.current, arm.commanders.overriding) == ("/leader", False)
    assert arm.readers["/command"].accepted == 40
