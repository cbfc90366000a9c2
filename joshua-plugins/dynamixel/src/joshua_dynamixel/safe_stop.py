"""Brings an arm into its safe state without its driver: the action of the guardian. Light to import."""

from __future__ import annotations

from joshua_servo.safe_stop import ServoStopRequest

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.family import X_SERIES


class DynamixelStopRequest(ServoStopRequest):
    """The safe stop of servos of this family."""

    family = X_SERIES
    make_bus = Bus
