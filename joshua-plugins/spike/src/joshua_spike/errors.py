"""Errors between host and hub: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceDisconnected, DeviceError
from joshua.api import SafetyTripped as _SafetyTripped


class AdapterUnusable(DeviceError):
    """There is no Bluetooth adapter, or it does not work."""


class HubNotFound(DeviceError):
    """No hub of that name is advertising: it is off, out of range, or connected elsewhere."""


class HubUnreachable(DeviceError):
    """The hub advertises, but no connection is established."""


class WrongFirmware(DeviceError):
    """The hub runs LEGO's firmware or an outdated version of Pybricks."""


class MotorCheckFailed(DeviceError):
    """The motors on the hub's ports do not match the configuration."""


class ProgramFailed(DeviceDisconnected):
    """The program on the hub does not start, or ended unexpectedly."""


class LinkLost(DeviceDisconnected):
    """The link to the hub was lost, or carries no data."""


class NotCalibrated(DeviceError):
    """Torque may not be enabled without a calibration."""


class NotEnabled(DeviceError):
    """A goal was written while torque is off."""


class SafetyTripped(_SafetyTripped):
    """The hub's dead man's switch stopped the motors; they stay stopped until enabled again."""
