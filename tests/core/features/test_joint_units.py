"""Units of joints against LeRobot's formulas, written down once more here in ticks."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.features import CalibratedJoint, Feature, JointUnits, Unit
from joshua.plan import JointRange
from joshua.plan.feature import STATE

PI = math.pi


def motor(low: int, high: int, inverted: bool, name: str = "elbow") -> SimpleNamespace:
    return SimpleNamespace(joint_name=name, range_min=low, range_max=high, inverted=inverted)


def radians(ticks: float, inverted: bool) -> float:
    """As drivers give them: about the middle of the turn, which the homing offset has moved to zero."""
    return (-1 if inverted else 1) * (ticks - 2048) * 2 * PI / 4096


def lerobot(ticks: int, low: int, high: int, inverted: bool, mode: str) -> float:
    """LeRobot's normalisation of a position in ticks."""
    if mode == "degrees":
        return (ticks - (low + high) / 2) * 360 / 4095
    share = (min(max(ticks, low), high) - low) / (high - low)
    if mode == "0_100":
        return 100 - share * 100 if inverted else share * 100
    return -(share * 200 - 100) if inverted else share * 200 - 100


def ticks_of(value: float, low: int, high: int, inverted: bool, mode: str) -> int:
    """LeRobot's way back, which cuts the fraction off."""
    if mode == "degrees":
        return int(value * 4095 / 360 + (low + high) / 2)
    if mode == "0_100":
        value = 100 - value if inverted else value
        return int(min(max(value, 0), 100) / 100 * (high - low) + low)
    value = -value if inverted else value
    return int((min(max(value, -100), 100) + 100) / 200 * (high - low) + low)


MODES = {"m100_100": ("elbow", Unit.LEROBOT), "0_100": ("gripper", Unit.LEROBOT)}
MODES["degrees"] = ("elbow", Unit.LEROBOT_DEGREES)
ranges = st.tuples(st.integers(0, 4095), st.integers(0, 4095)).filter(lambda pair: pair[0] < pair[1])


@pytest.mark.parametrize("mode", MODES)
@given(ranges=ranges, ticks=st.integers(0, 4095), inverted=st.booleans())
def test_every_position_in_ticks_is_what_lerobot_makes_of_it(
    mode: str, ranges: tuple[int, int], ticks: int, inverted: bool
) -> None:
    name, unit = MODES[mode]
    units = JointUnits.from_calibration([motor(*ranges, inverted, name)])
    given_rad = radians(ticks, inverted)
    (value,) = units.from_radians([given_rad], unit, clip=True)
    assert value == pytest.approx(lerobot(ticks, *ranges, inverted, mode), abs=1e-9)
    if ranges[0] <= ticks <= ranges[1] or mode == "degrees":
        (back_rad,) = units.to_radians([value], unit)
        assert back_rad == pytest.approx(given_rad, abs=1e-12)
        sign = -1 if inverted else 1
        assert round(sign * back_rad * 4096 / (2 * PI) + 2048) == ticks, "not a tick is lost"


@pytest.mark.parametrize("mode", MODES)
@given(ranges=ranges, share=st.floats(0, 1), inverted=st.booleans())
def test_every_value_of_lerobot_is_the_position_that_it_would_command(
    mode: str, ranges: tuple[int, int], share: float, inverted: bool
) -> None:
    name, unit = MODES[mode]
    value = {"m100_100": 200 * share - 100, "0_100": 100 * share, "degrees": 180 * share - 90}[mode]
    units = JointUnits.from_calibration([motor(*ranges, inverted, name)])
    (position,) = units.to_radians([value], unit)
    ticks = (-1 if inverted else 1) * position * 4096 / (2 * PI) + 2048
    assert abs(ticks - ticks_of(value, *ranges, inverted, mode)) <= 1 + 1e-9, (
        "less than the cut fraction apart"
    )


finite = st.floats(-10, 10)


@pytest.mark.parametrize("unit", Unit)
@given(st.lists(st.tuples(finite, st.floats(0.01, 6), finite, st.booleans()), max_size=7))
def test_there_and_back_is_the_same_position(
    unit: Unit, joints: list[tuple[float, float, float, bool]]
) -> None:
    units = JointUnits(
        CalibratedJoint(f"joint_{i}", low, low + width, inverted, percent=inverted)
        for i, (low, width, _, inverted) in enumerate(joints)
    )
    positions = np.array([[position for *_, position, _ in joints]] * 3)
    back = units.to_radians(units.from_radians(positions, unit), unit)
    assert back.shape == positions.shape
    assert np.abs(back - positions).max(initial=0) <= 1e-12


def test_units_agree_where_they_are_easy() -> None:
    units = JointUnits.from_ranges([JointRange("elbow", -1.0, 3.0), JointRange("gripper", 0.0, 2.0)])
    assert units.from_radians([1.0, 1.0], Unit.LEROBOT).tolist() == [0.0, 50.0]
    assert units.from_radians([-1.0, 0.0], Unit.LEROBOT).tolist() == [-100.0, 0.0]
    assert units.from_radians([PI, PI / 2], Unit.DEGREES).tolist() == [180.0, 90.0]
    assert units.from_radians([9.0, -9.0], Unit.LEROBOT, clip=True).tolist() == [100.0, 0.0]
    assert units.from_radians([1.0, 2.0], Unit.LEROBOT_DEGREES, clip=True).tolist() == [0.0, 100.0]
    assert units.chosen(("gripper",)).to_radians([50.0], Unit.LEROBOT) == [1.0]


def test_a_feature_says_its_unit_and_has_lerobots_names() -> None:
    units = JointUnits.from_ranges([JointRange("elbow", -1.0, 1.0), JointRange("left_gripper", 0.0, 1.0)])
    state = Feature.joints(STATE, units.names)
    normalised = units.feature(state, Unit.LEROBOT)
    assert (normalised.unit, normalised.names) == ("lerobot", ("elbow.pos", "left_gripper.pos"))
    assert units.feature(state, Unit.DEGREES).names == units.names
    assert [joint.percent for joint in units.joints] == [False, True]


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (1.0, 0.0), (0.0, math.inf), (math.nan, 1.0)])
def test_an_empty_range_is_refused(low: float, high: float) -> None:
    with pytest.raises(ValueError, match=r"elbow: .* rad is no valid range: calibrate the joint, or"):
        CalibratedJoint("elbow", low, high)


def test_two_joints_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="two joints have one name: elbow, elbow"):
        JointUnits.from_ranges([JointRange("elbow", 0, 1)] * 2)
