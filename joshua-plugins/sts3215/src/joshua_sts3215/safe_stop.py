"""Brings an arm into its safe state without its driver: the action of the guardian. Light to import."""

from __future__ import annotations

from joshua_servo.safe_stop import ServoStopRequest

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215


class Sts3215StopRequest(ServoStopRequest):
    """The safe stop of servos of this family."""

    family = STS3215
    make_bus = Bus
