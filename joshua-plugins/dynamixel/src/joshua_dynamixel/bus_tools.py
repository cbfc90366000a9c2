"""Dynamixel buses outside a run: find servos, and assign id and line speed to one."""

from __future__ import annotations

from joshua_servo.bus import ServoBus
from joshua_servo.bus_tools import FoundMotor
from joshua_servo.register import Register
from joshua_servo.servo_bus_tools import ServoBusTools, SetUp

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.feedback import parse_feedback
from joshua_dynamixel.models import MODELS, model_name
from joshua_dynamixel.registers import (
    BAUDRATE,
    BAUDRATES,
    DRIVE_MODE,
    FEEDBACK,
    FIRMWARE,
    HARDWARE_ERROR,
    HARDWARE_ERRORS,
    ID,
    MAX_TEMPERATURE,
    MAX_VOLTAGE,
    MIN_VOLTAGE,
    MODEL,
    OPERATING_MODE,
    RETURN_DELAY,
    SETUP,
    STATUS_LEVEL,
    TORQUE_ENABLE,
    OperatingMode,
)

LARGEST_ID = 252
_USUAL = 1_000_000


class DynamixelBusTools(ServoBusTools):
    """X-series servos on one port."""

    family = "Dynamixel servos"
    baudrates = (_USUAL, *(speed for speed in BAUDRATES.values() if speed != _USUAL))
    ids = range(LARGEST_ID + 1)
    expected_models = tuple(MODELS)
    make_bus = Bus
    set_up = SetUp(
        torque_enable=TORQUE_ENABLE,
        motor_id=ID,
        baudrate=BAUDRATE,
        codes=BAUDRATES,
        working={
            STATUS_LEVEL: 2,
            DRIVE_MODE: 0,
            OPERATING_MODE: OperatingMode.EXTENDED_POSITION,  # the only mode that accepts any homing offset
            RETURN_DELAY: 0,
        },
        quiet_s=0.8,  # the vendor allows 3 ms for each id below the one that replies
        calls=1,
        looks=1,
    )

    def read_motor(self, bus: ServoBus, servo_id: int) -> FoundMotor:
        """Read the data of a servo. Raises NoReply and PortDisconnected."""
        blocks = {address: bus.read_block(servo_id, address, length) for address, length in SETUP}
        feedback = parse_feedback(bus.read_block(servo_id, *FEEDBACK))

        def value(register: Register) -> int:
            start = max(address for address in blocks if address <= register.address)
            return register.decode(blocks[start][register.address - start :])

        return FoundMotor(
            servo_id,
            bus.port.baudrate,
            model_name(value(MODEL)),
            str(value(FIRMWARE)),
            feedback.voltage_v,
            float(feedback.temperature_c),
            float(value(MAX_TEMPERATURE)),
            value(MIN_VOLTAGE) / 10,
            value(MAX_VOLTAGE) / 10,
            HARDWARE_ERRORS.describe(value(HARDWARE_ERROR)),
        )
