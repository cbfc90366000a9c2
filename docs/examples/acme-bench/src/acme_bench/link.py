"""Requests of the clamp; without numpy, because the safe stop imports it.

A request is ``S`` (state), ``T1`` and ``T0`` (torque on, off) or ``G 750`` (goal in mrad) and a line feed.
The reply is torque, position in mrad and speed in mrad/s: ``1 +00750 -00020`` and a line feed.
"""

import re
import time
from dataclasses import dataclass

from joshua.api import DeviceSilent
from joshua_serial.port import SerialPort

REPLY = re.compile(rb"([01]) ([+-]\d{5}) ([+-]\d{5})\n")
REPLY_SIZE = 16
TIMEOUT_S = 0.2


@dataclass(frozen=True)
class State:
    """What the clamp answers, in SI units."""

    torque: bool
    position_rad: float
    velocity_rad_s: float


def ask(port: SerialPort, request: str) -> State:
    """Send a request and return the reply. Raises DeviceSilent, DeviceDisconnected."""
    port.send(request.encode() + b"\n")
    reply = port.receive(REPLY_SIZE, time.monotonic() + TIMEOUT_S)
    match = REPLY.fullmatch(reply)
    if match is None:
        raise DeviceSilent(f"{port}: no reply to {request!r} within {TIMEOUT_S:g} s. Check its supply")
    return State(match[1] == b"1", int(match[2]) / 1000, int(match[3]) / 1000)


def goal(position_rad: float) -> str:
    """Return the request that sets a goal."""
    return f"G {round(position_rad * 1000)}"
