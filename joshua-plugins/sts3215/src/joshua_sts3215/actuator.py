"""The actuator: an arm of STS3215 servos on one bus, in radians."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from joshua_serial.port import SerialPort
from joshua_servo.arm import ServoArm
from joshua_servo.feedback import Feedback
from joshua_servo.inspection import ServoSetup, check_start
from joshua_servo.torque import MoveValues

from joshua_sts3215.bus import Bus
from joshua_sts3215.family import STS3215
from joshua_sts3215.inspection import inspect
from joshua_sts3215.registers import ACCELERATION, GOAL_SPEED, GOAL_TIME
from joshua_sts3215.safe_stop import Sts3215StopRequest
from joshua_sts3215.settings import Sts3215Settings

if TYPE_CHECKING:
    from joshua_sts3215.calibration_target import Sts3215CalibrationTarget

BEYOND_TICKS = 30  # about 2.6°, for a joint that its stop has pushed slightly past its calibrated range


class Sts3215Actuator(ServoArm):
    """An arm of STS3215 servos."""

    settings: Sts3215Settings
    family = STS3215
    stop_request = Sts3215StopRequest
    _bus: Bus

    @property
    def bus(self) -> Bus:
        """Bus, for set-up and calibration."""
        return self._bus

    def make_bus(self, port: SerialPort) -> Bus:
        """Return a bus that speaks the servos' protocol."""
        return Bus(port)

    def inspect(self) -> list[ServoSetup]:
        """Check the servos on the open bus and read their EEPROM, in joint order."""
        _, setups = inspect(self._bus, self.settings)
        return setups

    def calibration_target(self) -> Sts3215CalibrationTarget:
        """Return the calibration target: positions with torque off, and the EEPROM."""
        from joshua_sts3215.calibration_target import Sts3215CalibrationTarget

        return Sts3215CalibrationTarget(self.settings)

    def parse(self, values: Sequence[bytes]) -> list[Feedback]:
        """Read the feedback blocks, including faults that only the reply's error byte reports."""
        said, known = self._bus.status, self.family.status.known
        return [
            reading._replace(status=reading.status | said.get(servo_id, 0) & known)
            for servo_id, reading in zip(self.settings.motor_ids, super().parse(values), strict=True)
        ]

    def clear_faults(self, ids: Sequence[int]) -> None:
        """Disable torque again, which clears the latched bits of a fault that is over."""
        self._torque.switch_off(ids)

    def check_start(self, positions: Sequence[int], only: Collection[int] | None = None) -> None:
        """Reject a servo outside its limits: it would jump to them when torque is enabled."""
        check_start(self._bus, self.joint_names, self._setups, positions, BEYOND_TICKS, only=only)

    def move_values(self) -> list[MoveValues]:
        """Acceleration and speed of a move."""
        general = self.settings.acceleration
        return [
            {
                ACCELERATION: general if joint.acceleration is None else joint.acceleration,
                GOAL_TIME: 0,
                GOAL_SPEED: self.settings.velocity_ticks_s,
            }
            for joint in self.settings.joint_settings
        ]
