"""Rules for writes to the control table, and their effect on the motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua_emulator.dynamixel.packets import ProtocolError
from joshua_emulator.dynamixel.registers import BY_ADDRESS, MEMORY_SIZE, OperatingMode
from joshua_emulator.dynamixel.units import ACCELERATION_TICKS_S2, VELOCITY_TICKS_S
from joshua_emulator.joint import TICKS_PER_TURN, Drive
from joshua_emulator.servo_bus.registers import Area, Register

if TYPE_CHECKING:
    from joshua_emulator.dynamixel.servo import Servo

FASTEST_TICKS_S2 = 150_000.0  # acceleration without a profile
_READ_ONLY = (Area.VERSION, Area.FEEDBACK, Area.FACTORY)


def written_registers(servo: Servo, address: int, data: bytes) -> tuple[ProtocolError, dict[Register, int]]:
    """Return the registers that a write covers with their values, or why the servo refuses the write."""
    if not data:
        return ProtocolError.DATA_LENGTH, {}
    end = address + len(data)
    if end > MEMORY_SIZE:
        return ProtocolError.ACCESS, {}
    written: dict[Register, int] = {}
    at = address
    while at < end:
        register = BY_ADDRESS.get(at)
        if register is None:
            at += 1
            continue
        if at + register.width > end:
            return ProtocolError.DATA_LENGTH, {}
        raw = int.from_bytes(data[at - address : at - address + register.width], "little")
        value = register.decode(raw)
        error = _refusal(servo, register, value)
        if error:
            return error, {}
        written[register] = value
        at += register.width
    return ProtocolError.NONE, written


def _refusal(servo: Servo, register: Register, value: int) -> ProtocolError:
    if register.area in _READ_ONLY:
        return ProtocolError.ACCESS
    if register.area is Area.EEPROM and servo.energised:
        return ProtocolError.ACCESS  # locked while torque is on
    if not register.minimum <= value <= register.maximum:
        return ProtocolError.DATA_RANGE
    if register.name == "torque_enable" and value and servo.shut_down:
        return ProtocolError.RESULT_FAIL  # only a reboot ends a shutdown
    name = register.name
    if name in ("profile_velocity", "goal_velocity") and abs(value) > servo.get("velocity_limit"):
        return ProtocolError.DATA_LIMIT
    is_joint = servo.get("operating_mode") == OperatingMode.POSITION
    if name == "goal_position" and is_joint:
        low, high = servo.get("min_position_limit"), servo.get("max_position_limit")
        if not low <= value <= high:
            return ProtocolError.DATA_LIMIT
    return ProtocolError.NONE


def make_drive(servo: Servo) -> Drive:
    """Return the motor command while torque is on."""
    fastest = min(servo.get("velocity_limit") * VELOCITY_TICKS_S, servo.model.rpm * TICKS_PER_TURN / 60)
    mode = servo.get("operating_mode")
    limit = servo.get("goal_pwm") / 885
    if mode == OperatingMode.CURRENT_POSITION and servo.model.current_unit_a:
        limit = min(limit, servo.get("goal_current") * servo.model.current_unit_a / servo.model.stall_a)
    if mode in (OperatingMode.VELOCITY, OperatingMode.PWM, OperatingMode.CURRENT):
        speed = {
            OperatingMode.VELOCITY: servo.get("goal_velocity") * VELOCITY_TICKS_S,
            OperatingMode.PWM: fastest * servo.get("goal_pwm") / 885,
        }.get(mode, 0.0)
        return Drive("speed", servo.direction * speed, fastest, FASTEST_TICKS_S2, abs(limit))
    return Drive(
        mode="position",
        target=servo.angle_at(servo.get("goal_position")),
        speed_limit=min(servo.get("profile_velocity") * VELOCITY_TICKS_S or fastest, fastest),
        acceleration=servo.get("profile_acceleration") * ACCELERATION_TICKS_S2 or FASTEST_TICKS_S2,
        torque_limit=abs(limit),
        stiffness=servo.get("position_p") / 25_000,
    )
