"""Register table of the STS3215 as data.

Sources: the vendor's memory table of the magnetic-encoder STS series, as public drivers and wikis carry it.
Where they conflict: baud codes 5 to 7 follow the table that public drivers use (57,600, 38,400, 19,200); the
return delay is honoured at 2 µs a unit, although some firmware is said to ignore it.
"""

from __future__ import annotations

from joshua_emulator.servo_bus.registers import Area, Register

MODEL_NUMBER = 777
MEMORY_SIZE = 96
EEPROM_START = 5
EEPROM_END = 40  # first address after the EEPROM

BAUDRATES = {0: 1_000_000, 1: 500_000, 2: 250_000, 3: 128_000, 4: 115_200, 5: 57_600, 6: 38_400, 7: 19_200}


_V, _E, _R, _F, _X = Area.VERSION, Area.EEPROM, Area.RAM, Area.FEEDBACK, Area.FACTORY

# name, address, width in bytes, area, default, minimum, maximum, sign bit; the unit stands behind each row
TABLE = (
    Register("firmware_major", 0, 1, _V, 3),
    Register("firmware_minor", 1, 1, _V, 10),
    Register("endianness", 2, 1, _V, 0),  # 0: little-endian
    Register("model_number", 3, 2, _V, MODEL_NUMBER),
    Register("id", 5, 1, _E, 1, 0, 253),
    Register("baudrate", 6, 1, _E, 0, 0, 7),  # code, see BAUDRATES
    Register("return_delay", 7, 1, _E, 0, 0, 254),  # 2 µs
    Register("status_level", 8, 1, _E, 1, 0, 1),  # 0: answers ping and reads only
    Register("min_position_limit", 9, 2, _E, 0, 0, 4094),  # ticks
    Register("max_position_limit", 11, 2, _E, 4095, 0, 4095),  # ticks
    Register("max_temperature", 13, 1, _E, 70, 0, 100),  # °C
    Register("max_voltage", 14, 1, _E, 140, 0, 254),  # 0.1 V
    Register("min_voltage", 15, 1, _E, 40, 0, 254),  # 0.1 V
    Register("max_torque", 16, 2, _E, 1000, 0, 1000),  # 0.1 % of stall torque
    Register("phase", 18, 1, _E, 12, 0, 254),
    Register("unload_condition", 19, 1, _E, 0x2C, 0, 254),  # status bits that take power off
    Register("alarm_condition", 20, 1, _E, 0x2F, 0, 254),  # status bits that light the LED
    Register("position_p", 21, 1, _E, 32, 0, 254),
    Register("position_d", 22, 1, _E, 32, 0, 254),
    Register("position_i", 23, 1, _E, 0, 0, 254),
    Register("min_startup_force", 24, 2, _E, 16, 0, 1000),  # 0.1 %
    Register("cw_dead_zone", 26, 1, _E, 1, 0, 32),  # ticks
    Register("ccw_dead_zone", 27, 1, _E, 1, 0, 32),  # ticks
    Register("protection_current", 28, 2, _E, 500, 0, 2047),  # 6.5 mA
    Register("angular_resolution", 30, 1, _E, 1, 1, 128),
    Register("homing_offset", 31, 2, _E, 0, -2047, 2047, 11),  # ticks
    Register("mode", 33, 1, _E, 0, 0, 3),  # 0 position, 1 velocity, 2 PWM, 3 step
    Register("protective_torque", 34, 1, _E, 20, 0, 100),  # % of stall torque after an overload
    Register("protection_time", 35, 1, _E, 200, 0, 254),  # 10 ms of overload before protection
    Register("overload_torque", 36, 1, _E, 80, 0, 100),  # % of stall torque that counts as overload
    Register("velocity_p", 37, 1, _E, 10, 0, 254),
    Register("over_current_time", 38, 1, _E, 200, 0, 254),  # 10 ms
    Register("velocity_i", 39, 1, _E, 10, 0, 254),
    Register("torque_enable", 40, 1, _R, 0, 0, 128),  # 0 off, 1 on, 128 makes the present position 2048
    Register("acceleration", 41, 1, _R, 0, 0, 254),  # 100 ticks/s²; 0 is the most
    Register("goal_position", 42, 2, _R, 0, -32767, 32767, 15),  # ticks
    Register("goal_time", 44, 2, _R, 0, -1000, 1000, 10),  # 0.1 % duty in mode 2
    Register("goal_speed", 46, 2, _R, 0, -32767, 32767, 15),  # ticks/s; 0 is the most in mode 0
    Register("torque_limit", 48, 2, _R, 1000, 0, 1000),  # 0.1 %; max_torque at power-on
    Register("lock", 55, 1, _R, 1, 0, 1),  # 1: writes to EEPROM are dropped
    Register("present_position", 56, 2, _F, sign_bit=15),  # ticks
    Register("present_speed", 58, 2, _F, sign_bit=15),  # ticks/s
    Register("present_load", 60, 2, _F, sign_bit=10),  # 0.1 % of stall torque
    Register("present_voltage", 62, 1, _F),  # 0.1 V
    Register("present_temperature", 63, 1, _F),  # °C
    Register("pending_write", 64, 1, _F),  # 1: a reg-write waits for its action
    Register("status", 65, 1, _F),  # bits: see Status
    Register("moving", 66, 1, _F),
    Register("target_position", 67, 2, _F, sign_bit=15),  # ticks
    Register("present_current", 69, 2, _F, sign_bit=15),  # 6.5 mA
    Register("moving_threshold", 80, 1, _X, 1),
    Register("control_period", 81, 1, _X, 1),  # ms
    Register("speed_unit", 82, 1, _X, 1),
    Register("max_speed", 84, 1, _X, 68),  # 50 ticks/s
    Register("max_acceleration", 85, 1, _X, 254),  # 100 ticks/s²
    Register("acceleration_factor", 86, 1, _X, 1),
)

BY_NAME = {register.name: register for register in TABLE}
BY_ADDRESS = {register.address: register for register in TABLE}


class Status:
    """Bits of the status register and of the error byte in replies."""

    VOLTAGE = 1 << 0
    ENCODER = 1 << 1
    TEMPERATURE = 1 << 2
    CURRENT = 1 << 3
    OVERLOAD = 1 << 5


def factory_memory() -> bytearray:
    """Return the factory state of the memory."""
    memory = bytearray(MEMORY_SIZE)
    for register in TABLE:
        memory[register.address : register.address + register.width] = register.encode(
            register.default
        ).to_bytes(register.width, "little")
    return memory
