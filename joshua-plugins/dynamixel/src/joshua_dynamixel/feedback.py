"""The 21 bytes of feedback that one read of a servo brings."""

from __future__ import annotations

import struct

from joshua_servo.feedback import Feedback

from joshua_dynamixel.models import Model
from joshua_dynamixel.registers import VELOCITY_TICKS_S

# Present load or current, velocity, position, two trajectories that are skipped, voltage, temperature.
_LAYOUT = struct.Struct("<hii8xHB")
_LOAD_ONLY = Model("", 0, 0.0, 0.0, 0.0)


def parse_feedback(data: bytes, model: Model = _LOAD_ONLY, hardware_error: int = 0) -> Feedback:
    """Reads the block at address 126.

    Args:
        model: says what the load is measured in.
        hardware_error: bits of the register of that name, which is read where a reply alerts.
    """
    load, velocity, position, voltage, temperature = _LAYOUT.unpack(data)
    return Feedback(
        position,
        velocity * VELOCITY_TICKS_S,
        model.load(load),
        voltage / 10,
        temperature,
        hardware_error,
        velocity != 0,
        model.current_a(load),
    )
