"""Emulated servos of each family without a process, for a line in virtual time."""

from __future__ import annotations

from typing import Any

from joshua_emulator.dynamixel.bus import DynamixelBus as EmulatedDynamixel
from joshua_emulator.dynamixel.models import MODELS
from joshua_emulator.dynamixel.servo import Servo as DynamixelServo
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.feetech.bus import FeetechBus
from joshua_emulator.feetech.servo import Servo as FeetechServo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply


def virtual_servos(protocol: str, ids: tuple[int, ...]) -> tuple[dict[int, Any], Any]:
    """Servos by their id, and the emulated bus that they are on."""
    servos: dict[int, Any] = {}
    for servo_id in ids:
        if protocol == "feetech":
            servos[servo_id] = FeetechServo(Joint(2048.0), Supply())
            values = {"id": servo_id, "return_delay": 0}
        else:
            servos[servo_id] = DynamixelServo(MODELS["xl330-m077"], Joint(2048.0), Supply(5.0))
            values = {"id": servo_id, "baudrate": 3, "return_delay": 0}
        for name, value in values.items():
            servos[servo_id].put(name, value)
    make = FeetechBus if protocol == "feetech" else EmulatedDynamixel
    return servos, make(list(servos.values()), EventLog(), Faults())
