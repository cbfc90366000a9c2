"""Errors between host and hub: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceDisconnected, DeviceError
from joshua.api import SafetyTripped as _SafetyTripped


class AdapterUnusable(DeviceError):
    """There is no Bluetooth adapter to look for the hub with, or it does not work."""


class HubNotFound(DeviceError):
    """No hub of that name advertises: it is off, out of range, or connected elsewhere."""


class HubUnreachable(DeviceError):
    """The hub advertises, but no connection is established."""


class WrongFirmware(DeviceError):
    """The hub runs LEGO's firmware, or a Pybricks that is too old."""


class MotorCheckFailed(DeviceError):
    """The motors on the hub's ports are not those of the configuration."""


class ProgramFailed(DeviceDisconnected):
    """The program on the hub does not start, or has ended by itself."""


class LinkLost(DeviceDisconnected):
    """The link to the hub is gone, or carries nothing any more."""


class NotCalibrated(DeviceError):
    """The joints may not be energised without a calibration."""


class NotEnabled(DeviceError):
    """A goal was written while the motors have no torque."""


class SafetyTripped(_SafetyTripped):
    """The hub's dead man's switch has stopped the motors; they stay so until they are enabled again."""
