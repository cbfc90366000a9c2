"""What a deflection does to goals: shaping, gate, integration, bounds."""

from __future__ import annotations

import math

import pytest
from gamepads import JOINTS, PAIR, STICK, gamepad_settings
from hypothesis import given
from hypothesis import strategies as st
from joshua_teleop_input.drive import TAIL_S, Drive, limits_of
from joshua_teleop_input.gate import Gate
from joshua_teleop_input.jog import LEAD_S, LEAST_LEAD_RAD, STATE_LIMIT_S, Jog
from joshua_teleop_input.shaping import with_expo, without_dead_zone

PERIOD_S = 0.02
unit = st.floats(-1, 1)


@given(unit, st.floats(0, 0.9))
def test_the_dead_zone_leaves_no_step_and_keeps_the_ends(value: float, zone: float) -> None:
    shaped = without_dead_zone(value, zone)
    assert abs(shaped) <= 1.0
    assert shaped * value >= 0.0
    assert (shaped == 0.0) == (abs(value) - zone <= 0.0) or abs(value) - zone < 1e-12
    assert without_dead_zone(math.copysign(1.0, value), zone) == math.copysign(1.0, value)


@given(unit, unit, st.floats(0, 1))
def test_expo_is_monotonous_and_gentler(first: float, second: float, expo: float) -> None:
    low, high = sorted((first, second))
    assert with_expo(low, expo) <= with_expo(high, expo) + 1e-12
    assert abs(with_expo(first, expo)) <= abs(first) + 1e-12
    assert with_expo(1.0, expo) == pytest.approx(1.0)


def test_not_a_number_moves_nothing() -> None:
    assert without_dead_zone(math.nan, 0.1) == 0.0


speeds = st.lists(st.floats(-3, 3), min_size=1, max_size=60)


@given(speeds, st.lists(st.floats(0.0, 0.1), min_size=60, max_size=60), st.floats(-1, 1))
def test_a_goal_never_leaves_its_bounds(velocities: list[float], waits: list[float], start: float) -> None:
    jog = Jog(["pan"], {"pan": (-1.0, 1.0)}, PERIOD_S)
    jog.observe({"pan": start}, 0.0)
    jog.begin()
    now_s = 0.0
    for velocity, wait_s in zip(velocities, waits, strict=False):
        before = jog.goal["pan"]
        goal = jog.advance({"pan": velocity} if velocity else {}, now_s)["pan"]
        lead = max(LEAST_LEAD_RAD, 3 * LEAD_S)
        assert -1.0 <= goal <= 1.0
        assert abs(goal - start) <= lead + 1e-9
        assert (goal - before) * velocity >= 0.0
        assert abs(goal - before) <= abs(velocity) * 2 * PERIOD_S + 1e-12
        now_s += wait_s


@given(st.lists(st.floats(0.001, 0.019), min_size=5, max_size=40), st.floats(0.1, 2))
def test_calls_between_two_periods_add_nothing(waits: list[float], speed: float) -> None:
    """Whatever the calls, a joint travels what its speed and the time say, and one period ahead."""
    jog = Jog(["pan"], {}, PERIOD_S)
    now_s = 0.0
    jog.observe({"pan": 0.0}, now_s)
    jog.begin()
    jog.advance({"pan": speed}, now_s)
    for wait_s in waits:
        now_s += wait_s
        jog.observe({"pan": speed * now_s}, now_s)
        jog.advance({"pan": speed}, now_s)
    assert jog.goal["pan"] == pytest.approx(speed * (now_s + PERIOD_S))


def test_a_goal_does_not_run_away_from_an_arm_that_is_blocked() -> None:
    jog = Jog(["pan"], {}, PERIOD_S)
    jog.observe({"pan": 0.3}, 0.0)
    jog.begin()
    for tick in range(200):
        jog.advance({"pan": 2.0}, tick * PERIOD_S)
    assert jog.goal["pan"] == pytest.approx(0.3 + 2.0 * LEAD_S)


def test_a_joint_outside_its_limits_can_only_come_back() -> None:
    jog = Jog(["pan"], {"pan": (-1.0, 1.0)}, PERIOD_S)
    jog.observe({"pan": 1.2}, 0.0)
    jog.begin()
    assert jog.advance({"pan": 1.0}, 0.0)["pan"] == 1.2
    assert jog.advance({"pan": -1.0}, 0.02)["pan"] < 1.2


def make_drive(dead_man: str = "", enable: str = "", block: str = STICK + PAIR) -> Drive:
    settings = gamepad_settings(block)
    jog = Jog([control.joint for control in settings.controls], limits_of(JOINTS), PERIOD_S)
    drive = Drive(settings.controls, Gate(dead_man, enable), jog, lambda value: without_dead_zone(value, 0.1))
    drive.jog.observe({"pan": 0.1, "lift": -0.2, "other": 9.0}, 0.0)
    return drive


def give(drive: Drive, **values: float) -> bool:
    return drive.take(lambda name: values.get(name, 0.0))


def test_motion_starts_from_where_the_joints_are() -> None:
    drive = make_drive(dead_man="left_bumper")
    give(drive)
    assert drive.command(0.0) is None
    assert give(drive, left_bumper=1.0)
    assert drive.command(0.0) == {"pan": 0.1, "lift": -0.2}
    assert give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(0.0) == {"pan": pytest.approx(0.12), "lift": -0.2}


def test_a_released_stick_stops_the_goal_at_once() -> None:
    drive = make_drive(dead_man="left_bumper")
    give(drive)
    give(drive, left_bumper=1.0, left_x=1.0)
    moved = drive.command(0.0)
    assert give(drive, left_bumper=1.0)
    assert drive.command(0.001) == moved
    assert drive.command(0.1) == moved
    assert drive.moving == {}


def test_a_released_dead_man_ends_the_commands() -> None:
    drive = make_drive(dead_man="left_bumper")
    give(drive)
    give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(0.0) is not None
    assert give(drive, left_x=1.0)
    assert drive.command(0.02) is None


def test_what_is_held_at_the_start_counts_only_after_a_release() -> None:
    drive = make_drive(dead_man="left_bumper")
    give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(0.0) is None
    give(drive, left_x=1.0)
    give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(0.0) == {"pan": 0.1, "lift": -0.2}, "the stick was never centred"
    give(drive, left_bumper=1.0)
    give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(0.02) != {"pan": 0.1, "lift": -0.2}


def test_the_switch_toggles_at_each_press_and_is_off_after_a_loss() -> None:
    drive = make_drive(enable="start")
    give(drive)
    give(drive, start=1.0)
    give(drive)
    assert drive.command(0.0) is not None
    assert drive.release()
    assert drive.command(0.01) is None
    give(drive, start=1.0)
    assert drive.command(0.02) is None, "held while the device came back"
    give(drive)
    give(drive, start=1.0)
    assert drive.command(0.02) is not None
    give(drive)
    give(drive, start=1.0)
    assert drive.command(0.04) is None


def test_without_a_switch_commands_end_after_the_last_motion() -> None:
    drive = make_drive()
    give(drive)
    assert drive.command(0.0) is None
    give(drive, a=1.0)
    assert drive.command(0.1) == {"pan": 0.1, "lift": pytest.approx(-0.19)}
    give(drive)
    assert drive.command(0.1 + TAIL_S / 2) is not None
    assert drive.command(0.2 + TAIL_S) is None


def test_nothing_moves_without_a_recent_state_of_the_arm() -> None:
    drive = make_drive(dead_man="left_bumper")
    give(drive)
    give(drive, left_bumper=1.0, left_x=1.0)
    assert drive.command(STATE_LIMIT_S - 0.1) is not None
    assert drive.command(STATE_LIMIT_S + 0.1) is None
    drive.jog.observe({"pan": 0.5}, 2.0)
    assert drive.command(2.0) is None, "where the other joint is was heard long ago"
    drive.jog.observe({"pan": 0.5, "lift": math.nan}, 2.0)
    assert drive.command(2.0) is None
    drive.jog.observe({"pan": 0.5, "lift": -0.2}, 2.0)
    assert drive.command(2.0) == {"pan": pytest.approx(0.52), "lift": -0.2}, "from where the arm is now"


def test_controls_of_one_joint_add_up_to_the_fastest() -> None:
    block = STICK + 'controls { positive: "a" joint: "pan" speed_rad_s: 1.0 }'
    drive = make_drive(block=block)
    give(drive)
    give(drive, a=1.0, left_x=1.0)
    drive.command(0.0)
    assert drive.moving == {"pan": 1.0}


@given(
    st.lists(
        st.dictionaries(st.sampled_from(["left_x", "a", "b", "left_bumper", "start"]), unit), max_size=40
    )
)
def test_goals_move_only_while_everything_allows_it(history: list[dict[str, float]]) -> None:
    drive = make_drive(dead_man="left_bumper", enable="start")
    last: dict[str, float] | None = None
    for tick, values in enumerate(history):
        drive.jog.observe({"pan": 0.1, "lift": -0.2}, tick * PERIOD_S)  # where it is stays known
        give(drive, **values)
        goal = drive.command(tick * PERIOD_S)
        if goal is None:
            assert not drive.gate.active
        else:
            assert values.get("left_bumper", 0.0) >= 0.5
            if last is not None and abs(values.get("left_x", 0.0)) <= 0.1:
                assert goal["pan"] == last["pan"]
        last = goal
