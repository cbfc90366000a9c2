"""Registers of the X series that the driver uses, as data.

Source: the vendor's control tables; the models that ``models`` lists agree in all of these.
"""

from __future__ import annotations

from joshua_servo.register import Register
from joshua_servo.status_bits import StatusBits

TICKS_PER_TURN = 4096
BAUDRATES = {0: 9_600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000}

VELOCITY_TICKS_S = 0.229 * TICKS_PER_TURN / 60  # one unit of a velocity: 0.229 rev/min
LARGEST_JOINT_OFFSET = 1024  # ticks; in position mode a servo ignores larger homing offsets
TIME_BASED = 1 << 2  # bit of the drive mode: profiles are times, not velocities

MODEL = Register("model", 0, 2)
FIRMWARE = Register("firmware", 6, 1)
ID = Register("id", 7, 1, eeprom=True)
BAUDRATE = Register("baudrate", 8, 1, eeprom=True)  # code, see BAUDRATES
RETURN_DELAY = Register("return_delay", 9, 1, eeprom=True)  # 2 µs
DRIVE_MODE = Register("drive_mode", 10, 1, eeprom=True)
OPERATING_MODE = Register("operating_mode", 11, 1, eeprom=True)
HOMING_OFFSET = Register("homing_offset", 20, 4, eeprom=True, signed=True)  # ticks, added to the position
MAX_TEMPERATURE = Register("max_temperature", 31, 1, eeprom=True)  # °C
MAX_VOLTAGE = Register("max_voltage", 32, 2, eeprom=True)  # 0.1 V
MIN_VOLTAGE = Register("min_voltage", 34, 2, eeprom=True)  # 0.1 V
VELOCITY_LIMIT = Register("velocity_limit", 44, 4, eeprom=True)  # 0.229 rev/min
MAX_POSITION = Register("max_position", 48, 4, eeprom=True)  # ticks; holds in position mode only
MIN_POSITION = Register("min_position", 52, 4, eeprom=True)  # ticks; holds in position mode only
TORQUE_ENABLE = Register("torque_enable", 64, 1)  # 1 locks the EEPROM
STATUS_LEVEL = Register("status_level", 68, 1)  # 2: every instruction is answered
HARDWARE_ERROR = Register("hardware_error", 70, 1)  # bits of HARDWARE_ERRORS; a reboot clears them
POSITION_D = Register("position_d", 80, 2)
POSITION_I = Register("position_i", 82, 2)
POSITION_P = Register("position_p", 84, 2)
GOAL_PWM = Register("goal_pwm", 100, 2, signed=True)  # 0.113 %, of 885 at most
GOAL_CURRENT = Register("goal_current", 102, 2, signed=True)  # the model's unit; holds in mode 5
PROFILE_ACCELERATION = Register("profile_acceleration", 108, 4)  # 214.577 rev/min²; 0: no limit
PROFILE_VELOCITY = Register("profile_velocity", 112, 4)  # 0.229 rev/min; 0: no limit
GOAL_POSITION = Register("goal_position", 116, 4, signed=True)  # ticks
PRESENT_LOAD = Register("present_load", 126, 2, signed=True)  # current in the model's unit, or 0.1 %
PRESENT_POSITION = Register("present_position", 132, 4, signed=True)  # ticks
PRESENT_TEMPERATURE = Register("present_temperature", 146, 1)  # °C

# Address ranges (first, one past the last) that exist in all models; a servo may refuse to read others.
SPANS = ((0, 14), (20, 28), (31, 38), (44, 56), (63, 66), (68, 71), (76, 86), (88, 92), (98, 99), (100, 148))

# Addresses and lengths of the blocks that hold a servo's settings: from MODEL to OPERATING_MODE,
# HOMING_OFFSET, from MAX_TEMPERATURE to MIN_VOLTAGE, from VELOCITY_LIMIT to MIN_POSITION, and from
# STATUS_LEVEL to HARDWARE_ERROR.
SETUP = ((0, 12), (20, 4), (31, 5), (44, 12), (68, 3))
FEEDBACK = (126, 21)  # address and length of the block from PRESENT_LOAD to PRESENT_TEMPERATURE

HARDWARE_ERRORS = StatusBits(
    {
        1 << 0: "voltage out of range",
        1 << 2: "too hot",
        1 << 3: "encoder fault",
        1 << 4: "electrical shock, or too little power",
        1 << 5: "overloaded",
    },
    voltage=1 << 0,
    overload=1 << 5,
)


class OperatingMode:
    """Values of OPERATING_MODE in which a servo moves to positions."""

    POSITION = 3
    EXTENDED_POSITION = 4
    CURRENT_POSITION = 5

    #: Modes in which a servo counts turns and ignores its position limits.
    MULTI_TURN = (EXTENDED_POSITION, CURRENT_POSITION)
    ALL = (POSITION, *MULTI_TURN)
