"""Calibration values from a middle pose and ranges, with plausibility checks."""

from __future__ import annotations

from joshua.api.calibration import MotorCalibration

from joshua_calibration.sweep import Sweep
from joshua_calibration.target import TargetMotor

MIDDLE_MARGIN = 0.1  # of the range: minimum distance of the middle pose from both ends


class RangeRefused(ValueError):
    """A joint's range cannot be used. The message gives reason and remedy."""


def homing_offset(motor: TargetMotor, home_raw: int) -> int:
    """Return the offset that maps the encoder position of the middle pose to half a turn.

    One position in a turn needs an offset that the motor cannot store. The nearest one is used, so the middle
    pose is off by one tick.
    """
    offset = home_raw - motor.ticks_per_turn // 2
    return max(-motor.largest_offset, min(motor.largest_offset, offset))


def motor_calibration(
    motor: TargetMotor, name: str, inverted: bool, sweep: Sweep, home: int, home_raw: int
) -> MotorCalibration:
    """Return the calibration of one motor.

    Args:
        home: unwrapped position of the middle pose; home_raw: the same as the raw encoder position.

    Raises:
        RangeRefused: the sweep is incomplete, or its range does not contain the middle pose.
    """
    require_range(motor, name, sweep, home)
    assert sweep.low is not None
    assert sweep.high is not None
    turn = motor.ticks_per_turn
    offset = homing_offset(motor, home_raw)
    if sweep.goes_round:
        low, high = 0, turn - 1
    else:
        middle = (home_raw - offset) % turn
        low, high = max(0, middle + sweep.low - home), min(turn - 1, middle + sweep.high - home)
    return MotorCalibration(
        id=motor.id,
        joint_name=name,
        homing_offset=offset,
        range_min=low,
        range_max=high,
        inverted=inverted,
    )


def require_range(motor: TargetMotor, name: str, sweep: Sweep, home: int) -> None:
    """Check that a range is complete and plausible. Raises RangeRefused."""
    degrees = 360 / motor.ticks_per_turn
    if sweep.too_far:
        raise RangeRefused(
            f"{name} turned {sweep.span * degrees:.0f}° without reaching a stop, more than a whole turn. A "
            "screw of its horn is loose, or readings were lost. Check the horn, then repeat this joint"
        )
    if not sweep.moved:
        raise RangeRefused(
            f"{name} did not move: {sweep.span * degrees:.0f}° seen, at least "
            f"{sweep.smallest_span * degrees:.0f}° needed. Move it from one end to the other"
        )
    require_middle(motor, name, sweep, home)
    if not sweep.goes_round and not (sweep.low_found and sweep.high_found):
        which = "low" if not sweep.low_found else "high"
        both = not sweep.low_found and not sweep.high_found
        ends = "its ends are" if both else f"its {which} end is"
        raise RangeRefused(
            f"{name}: {ends} not certain yet. Move it against both stops, and back from each by a few degrees"
        )
    if sweep.coverage < 1.0:
        raise RangeRefused(
            f"{name}: {1 - sweep.coverage:.0%} of its range was not measured, because readings were lost. "
            "Move it through its range once more"
        )


def require_middle(motor: TargetMotor, name: str, sweep: Sweep, home: int) -> None:
    """Check that a range contains the middle pose with a margin. Raises RangeRefused."""
    if sweep.low is None or sweep.high is None or sweep.goes_round:
        return
    half = motor.ticks_per_turn // 2
    below, above = home - sweep.low, sweep.high - home
    if below > half or above >= half:
        raise RangeRefused(
            f"{name}: its range extends more than half a turn from the middle pose, so that pose was not in "
            "the middle. Go back, put this joint in the middle of its range, and record the pose again"
        )
    if sweep.complete and min(below, above) < MIDDLE_MARGIN * sweep.span:
        share = below / sweep.span
        raise RangeRefused(
            f"{name}: the middle pose was at {share:.0%} of its range, allowed {MIDDLE_MARGIN:.0%} to "
            f"{1 - MIDDLE_MARGIN:.0%}. Go back, put this joint in the middle of its range, and record the "
            "pose again"
        )
