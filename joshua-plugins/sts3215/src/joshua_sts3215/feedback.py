"""The 15-byte feedback block of a servo."""

from __future__ import annotations

import struct

from joshua_servo.feedback import Feedback

_LAYOUT = struct.Struct("<HHHBBBBBHH")  # from present position to present current
CURRENT_UNIT_A = 0.0065


def parse_feedback(data: bytes) -> Feedback:
    """Read the block at address 56."""
    position, speed, load, voltage, temperature, _, status, moving, _, current = _LAYOUT.unpack(data)
    return Feedback(
        -(position & 0x7FFF) if position & 0x8000 else position,
        -(speed & 0x7FFF) if speed & 0x8000 else speed,
        (-(load & 0x3FF) if load & 0x400 else load & 0x3FF) / 1000,
        voltage / 10,
        temperature,
        status,
        bool(moving),
        (current & 0x7FFF) * CURRENT_UNIT_A,  # the bit above is the direction of flow
    )
