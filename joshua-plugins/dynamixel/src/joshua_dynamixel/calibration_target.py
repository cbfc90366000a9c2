"""The calibration target for the servos: encoder positions without torque, and their EEPROM."""

from __future__ import annotations

from collections.abc import Sequence

from joshua_serial.port import SerialPort
from joshua_servo.calibration_target import ServoCalibrationTarget
from joshua_servo.errors import MotorCheckFailed
from joshua_servo.inspection import ServoSetup
from joshua_servo.register import Register

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.family import X_SERIES
from joshua_dynamixel.inspection import read_setups
from joshua_dynamixel.registers import HOMING_OFFSET, LARGEST_JOINT_OFFSET, MAX_POSITION, MIN_POSITION
from joshua_dynamixel.settings import DynamixelSettings


class DynamixelCalibrationTarget(ServoCalibrationTarget):
    """An arm of X-series servos."""

    family = X_SERIES
    homing_offset, min_position, max_position = HOMING_OFFSET, MIN_POSITION, MAX_POSITION
    offset_sign = -1
    _settings: DynamixelSettings
    _bus: Bus
    _setups: dict[int, ServoSetup]

    def make_bus(self, port: SerialPort) -> Bus:
        """Return a bus that speaks the servos' protocol."""
        return Bus(port)

    @property
    def expected_models(self) -> dict[int, str]:
        """Expected model of each servo, by id."""
        return self._settings.models_by_id

    def read_setups(self) -> Sequence[ServoSetup]:
        """Read the EEPROM of all servos. Raises MotorCheckFailed if one is in the wrong operating mode."""
        self._setups = {setup.servo_id: setup for setup in read_setups(self._bus, self._settings.motor_ids)}
        return list(self._setups.values())

    def refuse_unfit(self, motor_id: int, registers: dict[Register, int]) -> None:
        """Reject values that a servo cannot store or would ignore, before the first register is written."""
        super().refuse_unfit(motor_id, registers)
        offset = registers[HOMING_OFFSET]
        if not self._setups[motor_id].turns and abs(offset) > LARGEST_JOINT_OFFSET:
            raise MotorCheckFailed(
                f"{self._port}: id {motor_id} is in mode 3 (position) and would ignore a homing offset of "
                f"{-offset} ticks; allowed {-LARGEST_JOINT_OFFSET} to {LARGEST_JOINT_OFFSET}. Run joshua "
                "motors setup to set mode 4 (extended position), which allows any."
            )
