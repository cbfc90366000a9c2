"""What can go wrong with a device; importable without numpy, for safe-stop processes."""

from __future__ import annotations


class DeviceError(Exception):
    """A device is absent, refuses, or answers wrongly; the message names device and remedy."""


class DeviceDisconnected(DeviceError):
    """A device that was connected does not answer any more."""
