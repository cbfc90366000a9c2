"""Brings an arm into its safe state without its driver: what a guardian runs. Light to import."""

from __future__ import annotations

from joshua_servo.safe_stop import ServoStopRequest

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215


class Sts3215StopRequest(ServoStopRequest):
    """What is to be done to which servos of this family."""

    family = STS3215
    make_bus = Bus
