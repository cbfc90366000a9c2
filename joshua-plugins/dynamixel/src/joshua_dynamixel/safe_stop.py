"""Brings an arm into its safe state without its driver: what a guardian runs. Light to import."""

from __future__ import annotations

from joshua_servo.safe_stop import ServoStopRequest

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.family import X_SERIES


class DynamixelStopRequest(ServoStopRequest):
    """What is to be done to which servos of this family."""

    family = X_SERIES
    make_bus = Bus
