"""Registers of the STS3215 that the driver uses, as data.

Source: the vendor's memory table of the magnetic-encoder STS series.
"""

from __future__ import annotations

from joshua_servo.register import Register
from joshua_servo.status_bits import StatusBits

MODEL_NUMBER = 777
MODEL_NAMES = {777: "STS3215", 1284: "SCS0009", 2825: "STS3250", 11272: "SM8512BL"}
TICKS_PER_TURN = 4096
MAX_SPEED_TICKS_S = 3400  # the servo's own maximum, about 5.2 rad/s
TORQUE_OFF, TORQUE_ON = 0, 1
POSITION_MODE = 0

# Baud rate by register code. Sources agree on codes 0 to 4 and disagree on the rest.
BAUDRATES = {0: 1_000_000, 1: 500_000, 2: 250_000, 3: 128_000, 4: 115_200, 5: 57_600, 6: 38_400, 7: 19_200}
OTHER_BAUDRATES = {5: 76_800, 6: 57_600, 7: 38_400}
LINE_SPEEDS = (*BAUDRATES.values(), 76_800)


FIRMWARE = Register("firmware", 0, 2)  # major, minor
MODEL = Register("model", 3, 2)
ID = Register("id", 5, 1, eeprom=True)
BAUDRATE = Register("baudrate", 6, 1, eeprom=True)  # code, see BAUDRATES
RETURN_DELAY = Register("return_delay", 7, 1, eeprom=True)  # 2 µs
STATUS_LEVEL = Register("status_level", 8, 1, eeprom=True)  # 1: the servo replies to every instruction
MIN_POSITION = Register("min_position", 9, 2, eeprom=True)  # ticks
MAX_POSITION = Register("max_position", 11, 2, eeprom=True)  # ticks
MAX_TEMPERATURE = Register("max_temperature", 13, 1, eeprom=True)  # °C
MAX_VOLTAGE = Register("max_voltage", 14, 1, eeprom=True)  # 0.1 V
MIN_VOLTAGE = Register("min_voltage", 15, 1, eeprom=True)  # 0.1 V
POSITION_P = Register("position_p", 21, 1, eeprom=True)
POSITION_D = Register("position_d", 22, 1, eeprom=True)
POSITION_I = Register("position_i", 23, 1, eeprom=True)
PROTECTION_CURRENT = Register("protection_current", 28, 2, eeprom=True)  # 6.5 mA
HOMING_OFFSET = Register("homing_offset", 31, 2, sign_bit=11, eeprom=True)  # ticks
MODE = Register("mode", 33, 1, eeprom=True)  # 0 position, 1 velocity, 2 PWM, 3 step
OVERLOAD_TIME = Register("overload_time", 35, 1, eeprom=True)  # 10 ms
OVERLOAD_TORQUE = Register("overload_torque", 36, 1, eeprom=True)  # % of stall torque
TORQUE_ENABLE = Register("torque_enable", 40, 1)
ACCELERATION = Register("acceleration", 41, 1)  # 100 ticks/s²; 0: maximum
GOAL_POSITION = Register("goal_position", 42, 2, sign_bit=15)  # ticks; a write enables torque
GOAL_TIME = Register("goal_time", 44, 2, sign_bit=10)
GOAL_SPEED = Register("goal_speed", 46, 2, sign_bit=15)  # ticks/s; 0: maximum
TORQUE_LIMIT = Register("torque_limit", 48, 2)  # 0.1 % of stall torque
LOCK = Register("lock", 55, 1)  # 1: ignores writes to the EEPROM
PRESENT_POSITION = Register("present_position", 56, 2, sign_bit=15)  # ticks
STATUS = Register("status", 65, 1)  # bits of StatusBit

EEPROM_SETUP = (5, 34)  # address and length of the block from ID to just beyond MODE
FEEDBACK = (56, 15)  # address and length of the block from PRESENT_POSITION to the present current


class StatusBit:
    """Bits of the status register and of the error byte in replies."""

    VOLTAGE = 1 << 0
    ENCODER = 1 << 1
    TEMPERATURE = 1 << 2
    CURRENT = 1 << 3
    OVERLOAD = 1 << 5


STATUS_BITS = StatusBits(
    {
        StatusBit.VOLTAGE: "voltage out of range",
        StatusBit.ENCODER: "encoder fault",
        StatusBit.TEMPERATURE: "too hot",
        StatusBit.CURRENT: "overcurrent",
        StatusBit.OVERLOAD: "overloaded",
    },
    voltage=StatusBit.VOLTAGE,
    overload=StatusBit.OVERLOAD,
)
