from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.devices.mapping import LeaderMapping
from joshua.plan import JointRange


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
