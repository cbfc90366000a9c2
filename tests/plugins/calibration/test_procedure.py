"""The procedure on arms that are only numbers, also where a person does something else than asked."""

from __future__ import annotations

import pytest
from calibration_hand import Hand
from hypothesis import example, given, settings
from hypothesis import strategies as st
from joshua.devices.calibration import ArmCalibration, MotorCalibration
from joshua_calibration.procedure import Procedure
from joshua_calibration.result import RangeRefused
from joshua_calibration.target import TargetMotor, arm_motors
from joshua_calibration.view import JointState, Step

THREE = tuple(TargetMotor(i, name) for i, name in ((1, "base"), (2, "elbow"), (3, "jaw")))


@pytest.fixture
def hand() -> Hand:
    return Hand(THREE, [4000, 100, 2048], [1200, 900, 500])


def message(hand: Hand) -> str:
    return hand.procedure.view().message


def test_a_whole_calibration(hand: Hand):
    hand.finish()
    assert hand.procedure.step is Step.REVIEW
    motors = hand.procedure.result("usb:A", "now").motors
    assert [motor.homing_offset for motor in motors] == [4000 - 2048, 100 - 2048, 0]
    assert [(motor.range_min, motor.range_max) for motor in motors] == [
        (848, 3248),
        (1148, 2948),
        (1548, 2548),
    ]
    hand.procedure.confirm()
    assert hand.procedure.step is Step.WRITE
    hand.procedure.written()
    assert hand.procedure.view().instruction == "Calibrated."


def test_names_and_directions_of_the_previous_calibration_stay():
    old = MotorCalibration(id=2, joint_name="ellbogen", range_max=100, inverted=True)
    procedure = Procedure(THREE, ArmCalibration(motors=(old,)))
    assert procedure.names == ("base", "ellbogen", "jaw")


def test_a_previous_name_that_another_joint_has_now_is_not_taken():
    old = MotorCalibration(id=2, joint_name="base", range_max=100)
    assert Procedure(THREE, ArmCalibration(motors=(old,))).names == ("base", "elbow", "jaw")


def test_an_arm_that_moves_has_no_middle_pose(hand: Hand):
    hand.rest()
    hand.move({1: 400})
    hand.procedure.confirm()
    assert hand.procedure.step is Step.HOMING
    assert message(hand) == "elbow is still moving. Hold the arm still, then confirm."


def test_the_middle_pose_needs_readings(hand: Hand):
    hand.procedure.confirm()
    assert message(hand) == "Hold the arm still for half a second, then confirm."
    assert hand.procedure.view().is_problem


def test_a_joint_that_did_not_move_is_refused(hand: Hand):
    hand.take_home()
    hand.procedure.confirm()
    assert hand.procedure.view().active == 0
    assert "base did not move: 0° seen, at least 15° needed" in message(hand)


def test_swapped_ids_are_guessed(hand: Hand):
    hand.take_home()
    hand.move({2: 2548})
    assert message(hand) == "jaw is moving. Move base instead."
    hand.procedure.confirm()
    assert "jaw moved instead: if you moved base, ids 1 and 3 are swapped." in message(hand)


def test_two_joints_that_move_together_are_refused_and_the_joint_starts_again(hand: Hand):
    hand.take_home()
    hand.move({0: 4300})
    hand.move({0: 5000, 1: 700})
    assert "elbow moved by " in message(hand)
    assert "together with base" in message(hand)
    assert hand.procedure.view().joints[0].coverage < 1 or not hand.procedure.view().ready
    hand.rest()
    hand.sweep(0, back_to=4000)
    hand.procedure.confirm()
    assert hand.procedure.view().joints[0].state is JointState.DONE
    hand.sweep(1, back_to=100)
    hand.procedure.confirm()
    hand.sweep(2)
    hand.procedure.confirm()
    motors = hand.procedure.result().motors
    assert (motors[0].range_min, motors[0].range_max) == (848, 3248)
    assert (motors[1].range_min, motors[1].range_max) == (1148, 2948)


def test_joints_that_shake_a_little_are_fine(hand: Hand):
    hand.take_home()
    hand.move({0: 3000, 1: 180, 2: 1950})
    hand.sweep(0, back_to=4000)
    hand.procedure.confirm()
    assert hand.procedure.view().joints[0].state is JointState.DONE


def test_an_end_counts_once_the_joint_has_come_back_from_it(hand: Hand):
    hand.take_home()
    hand.move({0: -(10**6)})
    hand.move({0: 10**6})
    joint = hand.procedure.view().joints[0]
    assert (joint.low_found, joint.high_found) == (True, False)
    hand.procedure.confirm()
    assert "base: its high end is not certain yet" in message(hand)
    assert hand.procedure.view().joints[0].note == "not accepted yet"
    hand.move({0: 5150})
    assert hand.procedure.view().ready
    assert message(hand) == hand.procedure.view().joints[0].note == ""


def test_starting_at_a_stop_is_no_end(hand: Hand):
    hand.take_home()
    hand.move({0: 10**6}, feed=True)
    hand.procedure.repeat(0)
    hand.move({0: 4000})
    hand.procedure.confirm()
    assert "its ends are not certain yet" in message(hand)


@pytest.mark.parametrize(("middle", "share"), [(4000 - 810, "5%"), (4000 + 870, "98%")])
def test_a_middle_pose_at_the_end_of_the_range_is_refused(middle: int, share: str):
    hand = Hand(THREE, [4000, 100, 2048], [900, 900, 500])
    hand.move({0: middle})
    hand.take_home()
    hand.sweep(0, back_to=4000)
    hand.procedure.confirm()
    assert f"base: the middle pose was at {share} of its range" in message(hand)
    hand.procedure.back()
    hand.take_home()
    hand.procedure.confirm()
    assert hand.procedure.view().joints[0].state is JointState.DONE, message(hand)


def test_a_range_beyond_half_a_turn_is_refused():
    hand = Hand(THREE, [4000, 100, 2048], [2040, 900, 500])
    hand.move({0: 4000 + 600})
    hand.take_home()
    hand.sweep(0, back_to=4000)
    hand.procedure.confirm()
    assert "more than half a turn from the middle pose" in message(hand)


def test_a_joint_with_stops_cannot_go_round():
    hand = Hand(THREE, [4000, 100, 2048], [2300, 900, 500])
    hand.take_home()
    hand.sweep(0)
    hand.procedure.confirm()
    assert "without reaching a stop, more than a whole turn" in message(hand)


def test_a_wrist_that_goes_round_has_the_whole_turn():
    motors = (TargetMotor(1, "wrist_roll", full_turn=True),)
    hand = Hand(motors, [700], [9000])
    hand.take_home()
    hand.move({0: 700 + 4200})
    assert hand.procedure.view().ready
    hand.procedure.confirm()
    (motor,) = hand.procedure.result().motors
    assert (motor.range_min, motor.range_max, motor.homing_offset) == (0, 4095, 700 - 2048)


def test_a_wrist_with_stops_has_the_range_between_them():
    hand = Hand((TargetMotor(1, "wrist_roll", full_turn=True),), [700], [1800])
    hand.finish()
    (motor,) = hand.procedure.result().motors
    assert (motor.range_min, motor.range_max) == (248, 3848)


@pytest.mark.parametrize(("raw", "offset", "middle"), [(0, -2047, 2047), (4095, 2047, 2048), (2048, 0, 2048)])
def test_no_middle_pose_overflows_the_offset(raw: int, offset: int, middle: int):
    hand = Hand((TargetMotor(1, "joint"),), [raw], [1000])
    hand.finish()
    (motor,) = hand.procedure.result().motors
    assert motor.homing_offset == offset
    assert (motor.range_min, motor.range_max) == (middle - 1000, middle + 1000)


def test_a_sweep_with_lost_readings_has_a_hole_until_the_joint_passes_again(hand: Hand):
    hand.take_home()
    hand.move({0: -(10**6)})
    hand.move({0: 3600})
    hand.move({0: 4400}, feed=False)
    hand.move({0: 10**6})
    assert "Readings were lost for 0.4 s while base moved." in message(hand)
    hand.move({0: 5000})
    hand.procedure.confirm()
    assert "% of its range was not measured" in message(hand)
    hand.sweep(0)
    hand.procedure.confirm()
    assert hand.procedure.view().joints[0].state is JointState.DONE


def test_a_turn_that_nobody_saw_is_no_end(hand: Hand):
    """The readings stop on the way down and come back on the way up: the low stop was never seen."""
    hand.take_home()
    hand.move({0: 3700})
    hand.move({0: -(10**6)}, feed=False)
    hand.move({0: 3760}, feed=False)
    hand.move({0: 10**6})
    hand.move({0: 4000})
    joint = hand.procedure.view().joints[0]
    assert (joint.low_found, joint.high_found) == (False, True)
    hand.procedure.confirm()
    assert "base: its low end is not certain yet" in message(hand)
    hand.sweep(0)
    hand.procedure.confirm()
    assert hand.procedure.view().joints[0].state is JointState.DONE
    assert hand.procedure.view().joints[0].low_deg == pytest.approx(-1200 * 360 / 4096)


def test_an_arm_that_does_not_answer_confirms_nothing(hand: Hand):
    hand.rest()
    hand.time_s += 1.0
    hand.procedure.lost(hand.time_s, "the adapter is gone")
    hand.procedure.confirm()
    assert hand.procedure.step is Step.HOMING
    assert message(hand) == "No answer from the arm: the adapter is gone"
    hand.feed()
    assert message(hand) == "The arm responds again."
    hand.take_home()
    assert hand.procedure.step is Step.SWEEP


def test_an_arm_that_is_gone_is_said_at_once(hand: Hand):
    hand.rest()
    hand.procedure.lost(hand.time_s, "no such serial port", gone=True)
    assert message(hand) == "No answer from the arm: no such serial port"
    hand.feed()
    assert message(hand) == "The arm responds again."


def test_one_lost_reading_is_no_event(hand: Hand):
    hand.rest()
    hand.time_s += 0.1
    hand.procedure.lost(hand.time_s, "no reply")
    assert message(hand) == ""
    hand.feed()
    hand.procedure.confirm()
    assert hand.procedure.step is Step.SWEEP


def test_a_joint_is_repeated_and_the_others_stay(hand: Hand):
    hand.finish()
    hand.procedure.repeat(1)
    view = hand.procedure.view()
    assert (view.step, view.active) == (Step.SWEEP, 1)
    assert [joint.state for joint in view.joints] == [JointState.DONE, JointState.ACTIVE, JointState.DONE]
    hand.sweep(1)
    hand.procedure.confirm()
    assert hand.procedure.step is Step.REVIEW


def test_a_joint_seen_beyond_its_range_is_to_be_repeated(hand: Hand):
    hand.stops[0] = (3500, 4500)
    hand.finish()
    hand.stops[0] = (2800, 5200)
    hand.move({0: 4700})
    view = hand.procedure.view()
    assert view.step is Step.SWEEP
    assert view.active == 0
    assert view.message == "base moved beyond its measured range. Repeat it."


def test_going_back_keeps_the_ranges(hand: Hand):
    hand.finish()
    hand.procedure.back()
    assert hand.procedure.step is Step.HOMING
    hand.move({0: 4100})
    hand.take_home()
    assert hand.procedure.step is Step.REVIEW
    assert hand.procedure.result().motors[0].range_min == 748


def test_a_failed_write_can_be_tried_again(hand: Hand):
    hand.finish()
    hand.procedure.confirm()
    hand.procedure.not_written("id 3 keeps its value")
    assert (hand.procedure.step, message(hand)) == (Step.REVIEW, "id 3 keeps its value")
    hand.procedure.confirm()
    assert hand.procedure.step is Step.WRITE


def test_no_result_without_a_middle_pose_and_ranges(hand: Hand):
    with pytest.raises(RangeRefused, match="middle pose has not been recorded"):
        hand.procedure.result()
    hand.take_home()
    with pytest.raises(RangeRefused, match="base did not move"):
        hand.procedure.result()


@pytest.mark.parametrize("index", [-1, 3])
def test_there_is_no_such_joint(hand: Hand, index: int):
    hand.take_home()
    hand.procedure.repeat(index)
    assert "cannot be repeated" in message(hand)


def test_requests_out_of_turn_are_refused(hand: Hand):
    hand.procedure.back()
    assert message(hand) == "There is no earlier step."
    hand.procedure.repeat(0)
    assert hand.procedure.step is Step.HOMING


@pytest.mark.parametrize("raw", [[0, 0], [0, 0, 4096], [-1, 0, 0]])
def test_readings_that_cannot_be_are_the_drivers_fault(hand: Hand, raw: list[int]):
    with pytest.raises(ValueError, match=r"positions for|outside"):
        hand.procedure.observe(1.0, raw)


def test_an_arm_of_a_known_build_that_hardly_moves_is_remarked_upon():
    hand = Hand(arm_motors(range(1, 7)), [2048] * 6, [1434, 600, 1000, 1200, 1800, 700])
    hand.finish()
    assert [joint.note for joint in hand.procedure.view().joints] == [
        "",
        "smaller than usual",
        "",
        "",
        "",
        "",
    ]


@settings(max_examples=60, deadline=None)
@given(
    middle=st.integers(0, 4095),
    half=st.integers(120, 2047),
    off=st.floats(-0.38, 0.38),
    speed=st.integers(8, 900),
)
@example(middle=0, half=120, off=-0.375, speed=8)  # an end that is nearer to the middle pose than 1/128 turn
@example(middle=0, half=120, off=0.375, speed=8)
def test_any_joint_gives_its_stops_back_wherever_its_encoder_wraps(
    middle: int, half: int, off: float, speed: int
):
    """The stops about the middle pose are the result, whatever the encoder reads there."""
    hand = Hand((TargetMotor(1, "joint"),), [middle], [half], speed)
    home = middle + round(off * 2 * half)
    hand.move({0: home})
    hand.take_home()
    hand.sweep(0, back_to=middle)
    hand.procedure.confirm()
    fits = home - (middle - half) <= 2048 and middle + half - home <= 2047
    assert (hand.procedure.step is Step.REVIEW) == fits, message(hand)
    if not fits:
        return
    (motor,) = hand.procedure.result().motors
    seen = (home - motor.homing_offset) % 4096
    assert abs(seen - 2048) <= 1
    assert motor.range_min == max(0, seen - (home - (middle - half)))
    assert motor.range_max == min(4095, seen + (middle + half - home))


_REQUESTS = st.one_of(
    st.tuples(st.just("observe"), st.lists(st.integers(0, 4095), min_size=3, max_size=3), st.floats(-1, 3)),
    st.tuples(st.just("nudge"), st.lists(st.integers(-60, 60), min_size=3, max_size=3), st.just(0.02)),
    st.tuples(st.sampled_from(["confirm", "back", "lost", "repeat"]), st.just([]), st.integers(-1, 4)),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(_REQUESTS, max_size=60))
def test_whatever_happens_the_procedure_stands_and_gives_only_whole_results(events: list) -> None:
    """Any readings and requests in any order: no exception, and a review only of calibrations that hold."""
    procedure, time_s, raw = Procedure(THREE), 0.0, [2000, 50, 4000]
    for kind, values, number in events:
        if kind in ("observe", "nudge"):
            time_s += number
            raw = values if kind == "observe" else [(a + b) % 4096 for a, b in zip(raw, values, strict=True)]
            procedure.observe(time_s, raw)
        elif kind == "lost":
            procedure.lost(time_s + number, "gone")
        elif kind == "repeat":
            procedure.repeat(int(number))
        else:
            getattr(procedure, kind)()
        view = procedure.view()
        assert all(0 <= joint.coverage <= 1 for joint in view.joints)
        assert view.step is not Step.REVIEW or all(joint.state is JointState.DONE for joint in view.joints)
        if view.step in (Step.REVIEW, Step.WRITE):
            procedure.result()
