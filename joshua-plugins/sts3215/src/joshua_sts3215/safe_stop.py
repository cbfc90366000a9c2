"""Brings an arm into its safe state without its driver: what a guardian runs. Light to import."""

from __future__ import annotations

import sys
from typing import Any

from joshua.devices.servo import safe_stop
from joshua.devices.servo.safe_stop import SafeStopReport, SafeStopRequest

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215


def run(request: SafeStopRequest) -> SafeStopReport:
    """Takes the port, applies the safe state and verifies it; never raises for what a device does."""
    return safe_stop.run(request, STS3215, Bus)


def stop(values: dict[str, Any]) -> dict[str, Any]:
    """Runs a request of plain values, as a guardian does. Raises ValueError and TypeError."""
    return safe_stop.stop(values, STS3215, Bus)


def main(arguments: list[str] | None = None) -> int:
    """Runs the request given as one argument of JSON; prints the report; 0 where it is complete."""
    (text,) = sys.argv[1:] if arguments is None else arguments
    report = run(SafeStopRequest.from_json(text))
    print(report.to_json())  # noqa: T201 - the result of this program
    return 0 if report.complete else 1


if __name__ == "__main__":
    sys.exit(main())
