"""The calibration target for the servos: encoder positions without torque, and their EEPROM."""

from __future__ import annotations

from collections.abc import Sequence

from joshua_serial.port import SerialPort
from joshua_servo.calibration_target import ServoCalibrationTarget
from joshua_servo.inspection import ServoSetup

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215
from joshua_sts3215.inspection import read_setups
from joshua_sts3215.registers import HOMING_OFFSET, MAX_POSITION, MIN_POSITION
from joshua_sts3215.settings import Sts3215Settings


class Sts3215CalibrationTarget(ServoCalibrationTarget):
    """An arm of STS3215 servos."""

    family = STS3215
    homing_offset, min_position, max_position = HOMING_OFFSET, MIN_POSITION, MAX_POSITION
    _settings: Sts3215Settings
    _bus: Bus

    def make_bus(self, port: SerialPort) -> Bus:
        """Return a bus that speaks the servos' protocol."""
        return Bus(port)

    @property
    def expected_models(self) -> dict[int, str]:
        """Expected model of each servo, by id."""
        return self._settings.models

    def read_setups(self) -> Sequence[ServoSetup]:
        """Read the EEPROM of all servos. Raises MotorCheckFailed if one is in the wrong operating mode."""
        return read_setups(self._bus, self._settings.motor_ids)
