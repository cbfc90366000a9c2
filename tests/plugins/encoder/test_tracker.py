"""Positions over many turns, and velocities."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_encoder.tracker import VELOCITY_WINDOW_NS, Tracker

STEP_NS = 5_000_000


def test_a_turn_is_two_pi() -> None:
    tracker = Tracker(4096, 0, inverted=False)
    tracker.add(1024, 0)
    assert tracker.position_rad == pytest.approx(math.pi / 2)
    assert tracker.velocity_rad_s == 0.0


def test_inversion_turns_position_and_velocity_round() -> None:
    tracker = Tracker(4096, 4096, inverted=True)
    tracker.add(0, 0)
    tracker.add(1024, 1_000_000_000)
    assert tracker.position_rad == pytest.approx(-math.pi / 2)
    assert tracker.velocity_rad_s == pytest.approx(-math.pi / 2)


@given(
    start=st.integers(0, 4095),
    steps=st.lists(st.integers(-2047, 2047), max_size=60),
    modulus=st.sampled_from([4096, 65536]),
)
def test_the_position_goes_on_over_the_end_of_the_counter(start: int, steps: list[int], modulus: int) -> None:
    tracker = Tracker(4096, modulus, inverted=False)
    true, time_ns = start, 0
    tracker.add(start, time_ns)
    for step in steps:
        true += step
        time_ns += STEP_NS
        tracker.add(true % modulus, time_ns)
        assert tracker.ticks == true


def test_the_velocity_is_that_of_the_last_stretch() -> None:
    tracker = Tracker(4096, 0, inverted=False)
    for number in range(100):
        tracker.add(number * 10, number * STEP_NS)
    per_second = 10 * math.tau / 4096 / (STEP_NS / 1e9)
    assert tracker.velocity_rad_s == pytest.approx(per_second)
    for number in range(100, 100 + 2 * VELOCITY_WINDOW_NS // STEP_NS):
        tracker.add(990, number * STEP_NS)
    assert tracker.velocity_rad_s == 0.0


def test_a_clock_that_begins_anew_begins_a_new_stretch() -> None:
    tracker = Tracker(4096, 0, inverted=False)
    tracker.add(0, 10**9)
    tracker.add(100, 10**9 + STEP_NS)
    tracker.add(200, 5)
    assert tracker.velocity_rad_s == 0.0
    tracker.add(300, 5 + STEP_NS)
    assert tracker.velocity_rad_s == pytest.approx(100 * math.tau / 4096 / (STEP_NS / 1e9))
