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
        """Bus, for set-up and calibration."""
        return self._bus

    def make_bus(self, port: SerialPort) -> Bus:
        """Return a bus that speaks the servos' protocol."""
        return Bus(port)

    def inspect(self) -> list[ServoSetup]:
        """Check the servos on the open bus and read their EEPROM, in joint order."""
        return inspect(self._bus, self.settings)

    def calibration_target(self) -> DynamixelCalibrationTarget:
        """Return the calibration target: positions with torque off, and the EEPROM."""
        from joshua_dynamixel.calibration_target import DynamixelCalibrationTarget

        return DynamixelCalibrationTarget(self.settings)

    def move_values(self) -> list[MoveValues]:
        """Return acceleration and speed of a move; a servo refuses a speed above its velocity limit."""
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
        """Read the feedback blocks, and the hardware error of servos that set the alert bit."""
        errors: dict[int, int] = {}
        alerted = self._bus.alerted(self.settings.motor_ids)
        if alerted:
            found = self._bus.sync_read(HARDWARE_ERROR.address, HARDWARE_ERROR.width, alerted)
            errors = {servo_id: HARDWARE_ERROR.decode(value) for servo_id, value in found.items()}
        rows = zip(self.settings.motor_ids, self._models, values, strict=True)
        return [parse_feedback(value, model, errors.get(servo_id, 0)) for servo_id, model, value in rows]

    @property
    def latched_faults(self) -> int:
        """Return all bits of a hardware error, including those of the supply."""
        return self.family.status.known

    def clear_faults(self, ids: Sequence[int]) -> None:
        """Reboot servos with a hardware error; their torque stays off until then."""
        self._bus.reboot(ids)

    def check_start(self, positions: Sequence[int], only: Collection[int] | None = None) -> None:
        """Reject a servo in position mode outside its limits, because it refuses goals there."""
        check_start(self._bus, self.joint_names, self._setups, positions, only=only)
