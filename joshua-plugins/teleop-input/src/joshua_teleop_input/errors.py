"""Errors of input devices."""

from __future__ import annotations

from joshua.api import DeviceError


class InputDeviceError(DeviceError):
    """A gamepad or the terminal cannot be used. The message names it and the remedy."""


class NoGamepadError(InputDeviceError):
    """The kernel shows no gamepad at all, or nothing that this user may read."""
