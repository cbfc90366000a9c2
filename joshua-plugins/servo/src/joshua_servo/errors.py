"""Errors between host and servos: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceError, DeviceSilent
from joshua.api import SafetyTripped as SafetyTripped


class NoReply(DeviceSilent):
    """A servo did not reply within all retries, or only with broken packets."""


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
