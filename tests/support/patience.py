"""Patience with an emulated bus: a machine that gives the emulator no time is not a servo that is silent."""

from __future__ import annotations

from typing import TypeVar

from joshua_servo.bus import REPLY_MARGIN_S, ServoBus

#: How long a reply is waited for where a servo does answer; one that is silent costs all of it, each time.
PATIENT_S = 3.0

#: Where a servo is silent on purpose, and the others must still be heard.
BRISK_S = 0.1

BusT = TypeVar("BusT", bound=ServoBus)


def patient(bus: BusT, margin_s: float = PATIENT_S) -> BusT:
    """Lets a bus wait longer for replies; not for the echo of an adapter that has none."""
    detect = bus.detect_echo

    def detect_echo() -> None:
        margin_s, bus.reply_margin_s = bus.reply_margin_s, REPLY_MARGIN_S
        try:
            detect()
        finally:
            bus.reply_margin_s = margin_s

    bus.detect_echo = detect_echo  # type: ignore[method-assign]
    bus.reply_margin_s = margin_s
    return bus
