"""Register addresses of X-series servos that the shared servo driver uses."""

from __future__ import annotations

from joshua_servo.family import ServoFamily

from joshua_dynamixel.feedback import parse_feedback
from joshua_dynamixel.registers import (
    FEEDBACK,
    GOAL_POSITION,
    HARDWARE_ERRORS,
    PRESENT_POSITION,
    PROFILE_ACCELERATION,
    PROFILE_VELOCITY,
    TORQUE_ENABLE,
    VELOCITY_TICKS_S,
)


def speed_of(ticks_s: int) -> int:
    """Return the profile velocity for a speed, at least 1 because 0 means no limit."""
    return max(1, int(ticks_s / VELOCITY_TICKS_S))


X_SERIES = ServoFamily(
    torque_enable=TORQUE_ENABLE,
    goal_position=GOAL_POSITION,
    present_position=PRESENT_POSITION,
    moves=(PROFILE_ACCELERATION, PROFILE_VELOCITY, GOAL_POSITION),
    kept=(PROFILE_ACCELERATION, PROFILE_VELOCITY),
    speed=PROFILE_VELOCITY,
    speed_of=speed_of,
    feedback=FEEDBACK,
    parse_feedback=parse_feedback,
    status=HARDWARE_ERRORS,
    reads_gaps=False,
)
