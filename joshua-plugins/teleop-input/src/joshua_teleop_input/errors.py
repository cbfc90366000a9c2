"""What can go wrong with an input device."""

from __future__ import annotations

from joshua.devices.errors import DeviceError


class InputDeviceError(DeviceError):
    """A gamepad or the terminal cannot be used; the message names it and the remedy."""
