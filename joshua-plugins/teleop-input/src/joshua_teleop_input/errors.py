"""Errors of input devices."""

from __future__ import annotations

from joshua.api import DeviceError


class InputDeviceError(DeviceError):
    """A gamepad or the terminal cannot be used. The message names the device and the remedy."""


class NoGamepadError(InputDeviceError):
    """The kernel lists no gamepad, or none that this user may read."""
