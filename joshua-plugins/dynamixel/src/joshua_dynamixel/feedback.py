"""The 21-byte feedback block of a servo."""

from __future__ import annotations

import struct

from joshua_servo.feedback import Feedback

from joshua_dynamixel.models import Model
from joshua_dynamixel.registers import VELOCITY_TICKS_S

# Present load or current, velocity, position, two trajectories (skipped), voltage, temperature.
_LAYOUT = struct.Struct("<hii8xHB")
_LOAD_ONLY = Model("", 0, 0.0, 0.0, 0.0)


def parse_feedback(data: bytes, model: Model = _LOAD_ONLY, hardware_error: int = 0) -> Feedback:
    """Read the block at address 126.

    Args:
        model: determines the unit of the load.
        hardware_error: bits of the register of that name, which is read if a reply sets the alert bit.
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
