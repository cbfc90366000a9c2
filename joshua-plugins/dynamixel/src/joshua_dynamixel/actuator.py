"""The actuator: an arm of X-series servos on one bus, in radians."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from joshua.api import ActuatorContext
from joshua_serial.port import SerialPort
from joshua_servo.arm import ServoArm
from joshua_servo.feedback import Feedback
from joshua_servo.inspection import ServoSetup, check_start
from joshua_servo.torque import MoveValues

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.family import X_SERIES
from joshua_dynamixel.feedback import parse_feedback
from joshua_dynamixel.inspection import inspect
from joshua_dynamixel.registers import (
    HARDWARE_ERROR,
    PROFILE_ACCELERATION,
    PROFILE_VELOCITY,
    VELOCITY_TICKS_S,
)
from joshua_dynamixel.safe_stop import DynamixelStopRequest
from joshua_dynamixel.settings import DynamixelSettings

if TYPE_CHECKING:
    from joshua_dynamixel.calibration_target import DynamixelCalibrationTarget


class DynamixelActuator(ServoArm):
    """An arm of Dynamixel X-series servos, in position, extended position or current-based position mode."""

    settings: DynamixelSettings
    family = X_SERIES
    stop_request = DynamixelStopRequest
    _bus: Bus

    def __init__(self, settings: DynamixelSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        self._models = settings.joint_models

    @property
    def bus(self) -> Bus:
        """The bus, for set-up and calibration."""
        return self._bus

    def make_bus(self, port: SerialPort) -> Bus:
        """Makes the bus of the servos' protocol."""
        return Bus(port)

    def inspect(self) -> list[ServoSetup]:
        """Checks the servos on the open bus and reads their EEPROM, in joint order."""
        return inspect(self._bus, self.settings)

    def calibration_target(self) -> DynamixelCalibrationTarget:
        """The calibration target for the servos: positions without torque, and their EEPROM."""
        from joshua_dynamixel.calibration_target import DynamixelCalibrationTarget

        return DynamixelCalibrationTarget(self.settings)

    def move_values(self) -> list[MoveValues]:
        """Acceleration and speed of a move; a servo refuses a speed above its velocity limit."""
        return [
            {
                PROFILE_ACCELERATION: self.settings.acceleration
                if joint.acceleration is None
                else joint.acceleration,
                PROFILE_VELOCITY: min(self.settings.velocity, round(setup.max_speed / VELOCITY_TICKS_S)),
            }
            for setup, joint in zip(self._setups, self.settings.joint_settings, strict=True)
        ]

    def parse(self, values: Sequence[bytes]) -> list[Feedback]:
        """Reads the blocks of feedback; asks servos that alert for their hardware error, too."""
        errors: dict[int, int] = {}
        alerted = self._bus.alerted(self.settings.motor_ids)
        if alerted:
            found = self._bus.sync_read(HARDWARE_ERROR.address, HARDWARE_ERROR.width, alerted)
            errors = {servo_id: HARDWARE_ERROR.decode(value) for servo_id, value in found.items()}
        rows = zip(self.settings.motor_ids, self._models, values, strict=True)
        return [parse_feedback(value, model, errors.get(servo_id, 0)) for servo_id, model, value in rows]

    @property
    def latched_faults(self) -> int:
        """All bits of a hardware error, the supply's included."""
        return self.family.status.known

    def clear_faults(self, ids: Sequence[int]) -> None:
        """Reboots servos with a hardware error, which keep their torque off until then."""
        self._bus.reboot(ids)

    def check_start(self, positions: Sequence[int], only: Collection[int] | None = None) -> None:
        """Refuses a servo in position mode that stands beyond its limits: it refuses such a goal."""
        check_start(self._bus, self.joint_names, self._setups, positions, only=only)
