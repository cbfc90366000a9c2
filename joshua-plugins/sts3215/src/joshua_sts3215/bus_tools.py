"""STS3215 buses outside a run: find servos, and assign id and line speed to one."""

from __future__ import annotations

from joshua_servo.bus import ServoBus
from joshua_servo.bus_tools import FoundMotor
from joshua_servo.servo_bus_tools import ServoBusTools, SetUp

from joshua_sts3215.bus import Bus
from joshua_sts3215.feedback import parse_feedback
from joshua_sts3215.registers import (
    BAUDRATE,
    BAUDRATES,
    FEEDBACK,
    ID,
    LINE_SPEEDS,
    LOCK,
    MAX_TEMPERATURE,
    MODE,
    MODEL,
    MODEL_NAMES,
    MODEL_NUMBER,
    OTHER_BAUDRATES,
    POSITION_MODE,
    RETURN_DELAY,
    STATUS_BITS,
    STATUS_LEVEL,
    TORQUE_ENABLE,
)

LARGEST_ID = 253
_VERSION = (0, MODEL.end)  # firmware and model
_LIMITS = (MAX_TEMPERATURE.address, 3)  # °C, then the maximum and minimum voltage in 0.1 V


class Sts3215BusTools(ServoBusTools):
    """STS-series servos with magnetic encoders on one port."""

    family = "STS3215 servos"
    baudrates = LINE_SPEEDS
    ids = range(LARGEST_ID + 1)
    expected_models = (MODEL_NAMES[MODEL_NUMBER],)
    make_bus = Bus
    set_up = SetUp(
        torque_enable=TORQUE_ENABLE,
        motor_id=ID,
        baudrate=BAUDRATE,
        codes=BAUDRATES,
        other_codes=OTHER_BAUDRATES,
        lock=LOCK,
        working={MODE: POSITION_MODE, STATUS_LEVEL: 1, RETURN_DELAY: 0},
    )

    def read_motor(self, bus: ServoBus, servo_id: int) -> FoundMotor:
        """Read the data of a servo. Raises NoReply and PortDisconnected."""
        version = bus.read_block(servo_id, *_VERSION)
        limits = bus.read_block(servo_id, *_LIMITS)
        feedback = parse_feedback(bus.read_block(servo_id, *FEEDBACK))
        model = MODEL.decode(version[MODEL.address :])
        return FoundMotor(
            servo_id,
            bus.port.baudrate,
            MODEL_NAMES.get(model, f"model {model}"),
            f"{version[0]}.{version[1]}",
            feedback.voltage_v,
            float(feedback.temperature_c),
            float(limits[0]),
            limits[2] / 10,
            limits[1] / 10,
            STATUS_BITS.describe(feedback.status),
        )
