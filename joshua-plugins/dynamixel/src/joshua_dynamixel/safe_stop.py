"""Brings an arm into its safe state without its driver: what a guardian runs. Light to import."""

from __future__ import annotations

from typing import Any

from joshua_servo import safe_stop
from joshua_servo.safe_stop import SafeStopReport, SafeStopRequest

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.family import X_SERIES


def run(request: SafeStopRequest) -> SafeStopReport:
    """Takes the port, applies the safe state and verifies it; never raises for what a device does."""
    return safe_stop.run(request, X_SERIES, Bus)


def stop(values: dict[str, Any]) -> dict[str, Any]:
    """Runs a request of plain values, as a guardian does. Raises ValueError and TypeError."""
    return safe_stop.stop(values, X_SERIES, Bus)
