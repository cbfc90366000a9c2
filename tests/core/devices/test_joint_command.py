from __future__ import annotations

import logging
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.devices.actuator import JointLimits
from joshua.devices.joint_command import CommandReader, LeaderMapping, TrajectoryCommand
from joshua.messages import message_class
from joshua.messages.make import header, joint_state
from joshua.plan import JointRange

LOG = logging.getLogger("test_joint_command")


def reader(**leaders: LeaderMapping) -> CommandReader:
    return CommandReader("/command", ("a", "b", "c"), LOG, leaders)


def raw_joint_state(names: list[str], positions: list[float]) -> Any:
    empty = np.zeros(0)
    return message_class("sensor_msgs/msg/JointState")(header(), names, np.array(positions), empty, empty)


def trajectory(names: list[str], *points: tuple[float, list[float]]) -> Any:
    duration = message_class("builtin_interfaces/msg/Duration")
    point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")
    empty = np.zeros(0)
    return message_class("trajectory_msgs/msg/JointTrajectory")(
        header(),
        names,
        [
            point(
                np.array(positions),
                empty,
                empty,
                empty,
                duration(math.floor(time_s), round((time_s % 1) * 1e9)),
            )
            for time_s, positions in points
        ],
    )


def test_joints_are_matched_by_name() -> None:
    command = reader().joint_state(joint_state(["c", "a"], [0.3, 0.1]))
    assert command is not None
    assert list(command.indices) == [2, 0]
    assert list(command.position_rad) == [0.3, 0.1]


def test_unknown_names_are_warned_about_once(caplog: pytest.LogCaptureFixture) -> None:
    one = reader()
    for _ in range(3):
        command = one.joint_state(joint_state(["x", "b"], [9.0, 0.2]))
        assert command is not None
        assert list(command.indices) == [1]
    assert caplog.messages == ["/command: the unknown joints 'x' are ignored; the joints are 'a', 'b', 'c'"]
    one.joint_state(joint_state(["b", "x"], [0.2, 9.0]))
    assert len(caplog.messages) == 1
    assert one.accepted == 4


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (raw_joint_state(["a", "b"], [0.1]), "2 names and 1 positions"),
        (raw_joint_state(["a"], []), "1 names and 0 positions"),
        (
            raw_joint_state([], []),
            "it names no known joint: it names nothing, the joints are 'a', 'b', 'c'",
        ),
        (raw_joint_state(["a", "a"], [0.1, 0.2]), "a joint is named twice"),
        (raw_joint_state(["x"], [0.1]), "it names no known joint: it names 'x'"),
        (raw_joint_state(["a", "b"], [0.1, math.nan]), "the position of 'b' is nan"),
        (raw_joint_state(["a"], [math.inf]), "the position of 'a' is inf"),
    ],
)
def test_what_cannot_be_trusted_is_refused(
    caplog: pytest.LogCaptureFixture, message: Any, reason: str
) -> None:
    one = reader()
    assert one.joint_state(message) is None
    assert (one.accepted, one.refused) == (0, 1)
    assert any(f"/command: command refused (1 so far): {reason}" in text for text in caplog.messages)


def test_refusals_do_not_flood_the_log(caplog: pytest.LogCaptureFixture) -> None:
    one = reader()
    for _ in range(250):
        one.joint_state(raw_joint_state(["a"], [math.nan]))
    assert one.refused == 250
    assert len(caplog.messages) == 3, "at the 1st, 10th and 100th"
    one.joint_state(raw_joint_state(["a", "a"], [0.1, 0.2]))
    assert "command refused (251 so far): a joint is named twice" in caplog.messages[-1], "another cause"


def test_causes_from_outside_are_counted_up_to_a_bound(caplog: pytest.LogCaptureFixture) -> None:
    one = reader()
    for number in range(1100):
        one.joint_state(raw_joint_state([f"stranger{number}"], [0.1]))
    assert len([text for text in caplog.messages if "refused" in text]) < 110
    assert len(one._causes) == 100


def test_names_from_outside_are_shown_bounded_and_quoted(caplog: pytest.LogCaptureFixture) -> None:
    reader().joint_state(raw_joint_state(["a\nFORGED LINE", "y" * 5000, *map(str, range(500))], [0.0] * 502))
    assert all("\n" not in text and len(text) < 1000 for text in caplog.messages)


def test_a_leaders_positions_pass_through_its_mapping() -> None:
    leader = [
        JointRange("l1", 0.0, 1.0),
        JointRange("extra", 0.0, 1.0),
    ]
    follower = [JointRange("b", -2.0, 2.0)]
    one = reader(**{"/leader": LeaderMapping(leader, follower)})
    command = one.joint_state(joint_state(["l1", "extra"], [0.25, 0.5]), "/leader")
    assert command is not None
    assert list(command.indices) == [1]
    assert command.position_rad == pytest.approx([-1.0])
    assert one.joint_state(raw_joint_state(["l1", "extra"], [math.nan, 0.0]), "/leader") is None


def test_other_publishers_of_a_leaders_topic_send_radians() -> None:
    ranges = [JointRange("b", 0.0, 1.0)]
    one = reader(**{"/leader": LeaderMapping(ranges, [JointRange("b", -2.0, 2.0)])})
    for _ in range(2):
        led = one.joint_state(joint_state(["b"], [0.25]), "/leader")
        other = one.joint_state(joint_state(["b"], [0.25]), "/gamepad")
        assert led is not None
        assert other is not None
        assert [*led.position_rad, *other.position_rad] == pytest.approx([-1.0, 0.25])


def test_a_trajectory_is_read_and_interpolated() -> None:
    command = reader().trajectory(trajectory(["b", "a"], (1.0, [1.0, -1.0]), (2.5, [4.0, -4.0])))
    assert command is not None
    assert list(command.indices) == [1, 0]
    start = np.array([0.5, 0.0])
    assert command.at(0.0, start) == pytest.approx([0.5, 0.0])
    assert command.at(0.5, start) == pytest.approx([0.75, -0.5])
    assert command.at(1.75, start) == pytest.approx([2.5, -2.5])
    assert command.at(99.0, start) == pytest.approx([4.0, -4.0])
    assert command.duration_s == 2.5


def test_a_trajectory_may_start_at_zero() -> None:
    command = reader().trajectory(trajectory(["a"], (0.0, [1.0]), (1.0, [2.0])))
    assert command is not None
    assert command.at(0.5, np.array([77.0])) == pytest.approx([1.5])


def test_a_trajectory_without_points_means_stop() -> None:
    command = reader().trajectory(trajectory([]))
    assert isinstance(command, TrajectoryCommand)
    assert len(command.time_s) == 0


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (trajectory(["a"], (1.0, [0.0]), (1.0, [0.1])), "does not increase from point to point"),
        (trajectory(["a"], (-1.0, [0.0])), "time_from_start is negative"),
        (trajectory(["a", "b"], (1.0, [0.0, 0.0]), (2.0, [0.1])), "2 names and 1 positions in point 1"),
        (trajectory(["a"], (1.0, [0.0]), (2.0, [math.inf])), "the position of 'a' is inf"),
        (trajectory(["x"], (1.0, [0.0])), "it names no known joint"),
    ],
)
def test_a_bad_trajectory_is_refused(caplog: pytest.LogCaptureFixture, message: Any, reason: str) -> None:
    one = reader()
    assert one.trajectory(message) is None
    assert one.refused == 1
    assert any(reason in text for text in caplog.messages)


def joint(name: str, low: float = -1.0, high: float = 1.0) -> JointRange:
    return JointRange(name, low, high)


def pairs(mapping: LeaderMapping) -> list[tuple[str, str]]:
    return [(pair.leader, pair.follower) for pair in mapping.pairs]


def test_the_fraction_of_the_range_carries_over() -> None:
    mapping = LeaderMapping([joint("elbow", 0.0, 2.0)], [joint("elbow", -3.0, 1.0)])
    (pair,) = mapping.pairs
    assert pair.position_rad(0.0) == -3.0
    assert pair.position_rad(1.0) == -1.0
    assert pair.position_rad(2.0) == 1.0
    assert pair.position_rad(9.0) == 1.0
    assert pair.position_rad(-9.0) == -3.0
    assert math.isnan(pair.position_rad(math.nan))


def test_joints_are_paired_by_name_whatever_their_order() -> None:
    mapping = LeaderMapping([joint("a"), joint("b")], [joint("b"), joint("a")])
    assert sorted(pairs(mapping)) == [("a", "a"), ("b", "b")]


def test_joints_without_a_namesake_are_paired_in_order() -> None:
    mapping = LeaderMapping(
        [joint("l1"), joint("grip"), joint("l2")], [joint("f1"), joint("f2"), joint("grip")]
    )
    assert pairs(mapping) == [("grip", "grip"), ("l1", "f1"), ("l2", "f2")]


def test_what_has_no_partner_is_known() -> None:
    mapping = LeaderMapping([joint("a"), joint("b"), joint("c")], [joint("a")])
    assert mapping.unpaired_leader == ("b", "c")
    assert mapping.unpaired_follower == ()
    assert mapping.pair("b") is None
    assert LeaderMapping([joint("a")], [joint("a"), joint("x")]).unpaired_follower == ("x",)


@pytest.mark.parametrize(
    ("leader", "follower", "message"),
    [
        ([], [joint("a")], "leader and follower have no joint in common"),
        (
            [joint("a", 1.0, 1.0)],
            [joint("a")],
            "joint a of the leader has no range: 1.0 to 1.0 rad; calibrate it",
        ),
        ([joint("a")], [joint("a", 2.0, 1.0)], "joint a of the follower has no range"),
        ([joint("a", math.nan)], [joint("a")], "joint a of the leader has no range"),
    ],
)
def test_arms_that_cannot_be_paired_are_refused(leader: Any, follower: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LeaderMapping(leader, follower)


finite = st.floats(-10, 10)


@given(st.tuples(finite, finite), st.tuples(finite, finite), st.floats(allow_nan=False))
def test_the_follower_stays_in_its_range(
    leader: tuple[float, float], follower: tuple[float, float], position: float
) -> None:
    low, high = sorted(leader)
    follower_low, follower_high = sorted(follower)
    if high - low < 1e-6 or follower_high - follower_low < 1e-6:
        return
    mapping = LeaderMapping([joint("a", low, high)], [joint("a", follower_low, follower_high)])
    mapped = mapping.pairs[0].position_rad(position)
    assert follower_low - 1e-9 <= mapped <= follower_high + 1e-9


def limited_reader(**leaders: LeaderMapping) -> CommandReader:
    limits = JointLimits(np.full(3, -2.0), np.full(3, 1.5), np.full(3, 5.0))
    return CommandReader("/command", ("a", "b", "c"), LOG, leaders, limits)


@pytest.mark.parametrize(("value", "shown"), [(10.0, "10"), (1e300, "1e+300"), (-2.02, "-2.02")])
def test_a_position_outside_the_limits_is_clipped_and_reported_once_for_each_commander_and_joint(
    value: float, shown: str, caplog: pytest.LogCaptureFixture
) -> None:
    one = limited_reader()
    for publisher in ("/talker", "/moveit"):
        for _ in range(3):
            command = one.joint_state(joint_state(["a", "c"], [value, 0.1]), publisher)
            assert command is not None
            assert list(command.position_rad) == [1.5 if value > 0 else -2.0, 0.1]
    assert caplog.messages == [
        f"/command: {publisher} commands a to {shown} rad, its limits are -2 to 1.5 rad: the joint stays "
        "within its limits. Further such commands are not logged"
        for publisher in ("/talker", "/moveit")
    ]
    one.joint_state(joint_state(["a", "c"], [value, 7.0]), "/talker")
    assert "/talker commands c to 7 rad" in caplog.messages[-1], "another joint"


def test_rounding_at_a_limit_is_not_reported(caplog: pytest.LogCaptureFixture) -> None:
    command = limited_reader().joint_state(joint_state(["a", "b"], [1.505, -2.005]), "/talker")
    assert command is not None
    assert list(command.position_rad) == [1.5, -2.0]
    assert caplog.messages == []


def test_each_point_of_a_trajectory_is_clipped(caplog: pytest.LogCaptureFixture) -> None:
    command = limited_reader().trajectory(trajectory(["b"], (1.0, [0.5]), (2.0, [1e308]), (3.0, [-1e308])))
    assert command is not None
    assert command.position_rad.tolist() == [[0.5], [1.5], [-2.0]]
    assert np.isfinite(command.at(2.5, np.zeros(1))).all()
    assert len(caplog.messages) == 1
    assert "commands b to 1e+308 rad" in caplog.messages[0]


def test_a_leader_far_outside_its_range_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    mapping = LeaderMapping([JointRange("l", 0.0, 1.0)], [JointRange("b", -2.0, 1.5)])
    one = limited_reader(**{"/leader": mapping})
    for position in (1.09, 1.2, 1e300):
        command = one.joint_state(joint_state(["l"], [position]), "/leader")
        assert command is not None
        assert list(command.position_rad) == [1.5]
    assert caplog.messages == [
        "/command: the leader /leader reports l at 1.2 rad, its range is 0 to 1 rad: b stays at the end "
        "of its own range. Calibrate the leader again, or widen its position_min and position_max"
    ]


def test_reports_of_positions_outside_the_limits_are_bounded(caplog: pytest.LogCaptureFixture) -> None:
    one = limited_reader()
    for number in range(1100):
        one.joint_state(joint_state(["a"], [9.0]), f"/stranger{number}")
    assert len(caplog.messages) == 1000
