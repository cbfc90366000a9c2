"""Register addresses of STS3215 servos that the shared servo driver uses."""

from __future__ import annotations

from joshua_servo.family import ServoFamily

from joshua_sts3215.feedback import parse_feedback
from joshua_sts3215.registers import (
    ACCELERATION,
    FEEDBACK,
    GOAL_POSITION,
    GOAL_SPEED,
    GOAL_TIME,
    PRESENT_POSITION,
    STATUS_BITS,
    TORQUE_ENABLE,
)

STS3215 = ServoFamily(
    torque_enable=TORQUE_ENABLE,
    goal_position=GOAL_POSITION,
    present_position=PRESENT_POSITION,
    moves=(ACCELERATION, GOAL_POSITION, GOAL_TIME, GOAL_SPEED),
    kept=(ACCELERATION, GOAL_SPEED),
    speed=GOAL_SPEED,
    speed_of=int,
    feedback=FEEDBACK,
    parse_feedback=parse_feedback,
    status=STATUS_BITS,
)
