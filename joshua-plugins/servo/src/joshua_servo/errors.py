"""Errors between host and servos: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceError, DeviceSilent
from joshua.api import SafetyTripped as SafetyTripped


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
    """The calibration belongs to another arm, or the servos were calibrated again."""


class NotCalibrated(DeviceError):
    """The joints may not be energised without a calibration."""


class NotEnabled(DeviceError):
    """A goal was written while torque is off; the servo would switch it on by itself."""


class ServoRefused(DeviceError):
    """A servo refused a request. The message says why."""
