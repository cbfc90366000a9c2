"""Errors between host and servos: one class per cause, each message with its remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from joshua.api import DeviceError, DeviceSilent
from joshua.api import SafetyTripped as SafetyTripped

if TYPE_CHECKING:
    from joshua_servo.inspection import ServoSetup


class NoReply(DeviceSilent):
    """A servo did not reply, or only with broken packets, or this process was too slow to tell.

    Args:
        garbled: most replies were broken, as if two servos replied at once.
        is_proof: the servo had the time to reply.
    """

    def __init__(self, text: str, *, garbled: bool = False, is_proof: bool = True) -> None:
        super().__init__(text)
        self.garbled = garbled
        self.is_proof = is_proof


class MotorCheckFailed(DeviceError):
    """The servos on the bus are not those of the configuration."""


class CalibrationMismatch(DeviceError):
    """The calibration belongs to another arm, or the servos were calibrated again.

    Args:
        port: of the servos; cause: of the mismatch; differences: one for each value.
        remedy: what to do, as lines.
        setups: of the servos, as read.
    """

    def __init__(
        self,
        port: str,
        cause: str,
        differences: Sequence[str],
        remedy: Sequence[str],
        setups: Sequence[ServoSetup] = (),
    ) -> None:
        head = f"{port}: the calibration does not match these servos: {cause}"
        super().__init__("\n  ".join([head, *differences, *remedy]))
        self.port, self.differences, self.setups = port, differences, setups

    def explained(self, cause: str, remedy: Sequence[str]) -> CalibrationMismatch:
        """The same error with a cause and a remedy that are known to be right."""
        return CalibrationMismatch(self.port, cause, self.differences, remedy, self.setups)


class NotCalibrated(DeviceError):
    """The joints may not be energised without a calibration."""


class NotEnabled(DeviceError):
    """A goal was written while torque is off; the servo would switch it on by itself."""


class ServoRefused(DeviceError):
    """A servo refused a request. The message says why."""
