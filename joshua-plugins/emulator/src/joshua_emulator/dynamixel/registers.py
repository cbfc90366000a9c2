"""Control table of the X series as data.

Source: the vendor's manual. Initial values that differ from model to model stand in ``models``.
"""

from __future__ import annotations

from joshua_emulator.servo_bus.registers import Area, Register

MEMORY_SIZE = 662  # the last indirect data of the larger models stand at 661
EEPROM_START = 7
EEPROM_END = 64  # first address after the EEPROM

BAUDRATES = {0: 9_600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000}

_V, _E, _R, _F, _X = Area.VERSION, Area.EEPROM, Area.RAM, Area.FEEDBACK, Area.FACTORY
_TURNS = 1_044_479  # ticks of 255 turns
_POSITION = 1_048_575  # ticks of 256 turns

# name, address, width in bytes, area, default, minimum, maximum; the unit stands behind each row
TABLE = (
    Register("model_number", 0, 2, _V),
    Register("model_information", 2, 4, _V),
    Register("firmware", 6, 1, _V, 46),
    Register("id", 7, 1, _E, 1, 0, 252),
    Register("baudrate", 8, 1, _E, 1, 0, 6),  # code, see BAUDRATES
    Register("return_delay", 9, 1, _E, 250, 0, 254),  # 2 µs
    Register("drive_mode", 10, 1, _E, 0, 0, 13),  # bits: 0 reverse, 2 time-based profile, 3 torque by goal
    Register("operating_mode", 11, 1, _E, 3, 0, 16),  # see OperatingMode
    Register("secondary_id", 12, 1, _E, 255, 0, 255),
    Register("protocol", 13, 1, _E, 2, 1, 22),
    Register("homing_offset", 20, 4, _E, 0, -_TURNS, _TURNS, signed=True),  # ticks, added to the encoder's
    Register("moving_threshold", 24, 4, _E, 10, 0, 1023),  # 0.229 rev/min
    Register("max_temperature", 31, 1, _E, 70, 0, 100),  # °C
    Register("max_voltage", 32, 2, _E, 160, 31, 160),  # 0.1 V
    Register("min_voltage", 34, 2, _E, 35, 31, 160),  # 0.1 V
    Register("pwm_limit", 36, 2, _E, 885, 0, 885),  # 0.113 %
    Register("current_limit", 38, 2, _E, 0, 0, 2047),  # the model's unit
    Register("velocity_limit", 44, 4, _E, 265, 0, 2047),  # 0.229 rev/min
    Register("max_position_limit", 48, 4, _E, 4095, 0, 4095),  # ticks
    Register("min_position_limit", 52, 4, _E, 0, 0, 4095),  # ticks
    Register("startup", 60, 1, _E, 0, 0, 3),
    Register("shutdown", 63, 1, _E, 52, 0, 63),  # bits of Hardware that take the torque off
    Register("torque_enable", 64, 1, _R, 0, 0, 1),
    Register("led", 65, 1, _R, 0, 0, 1),
    Register("status_level", 68, 1, _R, 2, 0, 2),  # 0 answers pings, 1 reads too, 2 everything
    Register("pending_write", 69, 1, _F),
    Register("hardware_error", 70, 1, _F),  # bits, see Hardware
    Register("velocity_i", 76, 2, _R, 1000, 0, 16383),
    Register("velocity_p", 78, 2, _R, 100, 0, 16383),
    Register("position_d", 80, 2, _R, 0, 0, 16383),
    Register("position_i", 82, 2, _R, 0, 0, 16383),
    Register("position_p", 84, 2, _R, 800, 0, 16383),
    Register("feedforward_2nd", 88, 2, _R, 0, 0, 16383),
    Register("feedforward_1st", 90, 2, _R, 0, 0, 16383),
    Register("bus_watchdog", 98, 1, _R, 0, -1, 127, signed=True),  # 20 ms; -1 after it has tripped
    Register("goal_pwm", 100, 2, _R, 885, -885, 885, signed=True),  # 0.113 %
    Register("goal_current", 102, 2, _R, 0, -2047, 2047, signed=True),
    Register("goal_velocity", 104, 4, _R, 0, -2047, 2047, signed=True),  # 0.229 rev/min
    Register("profile_acceleration", 108, 4, _R, 0, 0, 32767),  # 214.577 rev/min²; 0 is the most
    Register("profile_velocity", 112, 4, _R, 0, 0, 32767),  # 0.229 rev/min; 0 is the most
    Register("goal_position", 116, 4, _R, 0, -_POSITION, _POSITION, signed=True),  # ticks
    Register("realtime_tick", 120, 2, _F),  # ms
    Register("moving", 122, 1, _F),
    Register("moving_status", 123, 1, _F),
    Register("present_pwm", 124, 2, _F, signed=True),
    Register("present_load", 126, 2, _F, signed=True),  # current in the model's unit, or 0.1 %
    Register("present_speed", 128, 4, _F, signed=True),  # 0.229 rev/min
    Register("present_position", 132, 4, _F, signed=True),  # ticks
    Register("velocity_trajectory", 136, 4, _F, signed=True),
    Register("position_trajectory", 140, 4, _F, signed=True),
    Register("present_voltage", 144, 2, _F),  # 0.1 V
    Register("present_temperature", 146, 1, _F),  # °C
    Register("backup_ready", 147, 1, _F),
)

BY_NAME = {register.name: register for register in TABLE}
BY_ADDRESS = {register.address: register for register in TABLE}
DEFINED = frozenset(
    address for register in TABLE for address in range(register.address, register.address + register.width)
)


class OperatingMode:
    """Values of operating_mode."""

    CURRENT = 0
    VELOCITY = 1
    POSITION = 3
    EXTENDED_POSITION = 4
    CURRENT_POSITION = 5
    PWM = 16


class Hardware:
    """Bits of hardware_error and of shutdown."""

    VOLTAGE = 1 << 0
    TEMPERATURE = 1 << 2
    ENCODER = 1 << 3
    SHOCK = 1 << 4
    OVERLOAD = 1 << 5
