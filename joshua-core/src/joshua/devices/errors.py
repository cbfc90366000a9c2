"""What can go wrong with a device; importable without numpy, for safe-stop processes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from joshua.node.errors import EXIT_DEVICE_REFUSED, NodeError


class DeviceError(NodeError):
    """A device is absent, refuses, or answers wrongly; the message names device and remedy."""

    exit_code: ClassVar[int] = EXIT_DEVICE_REFUSED


class DeviceDisconnected(DeviceError):
    """A device that was connected does not answer any more."""


class DeviceSilent(DeviceDisconnected):
    """A device that is still connected did not answer; it may do so in a moment."""


class DeviceBusy(DeviceError):
    """Another process holds the device.

    Args:
        processes: ids of the processes that hold it, as far as they are known.
    """

    def __init__(self, text: str, *, processes: Sequence[int] = ()) -> None:
        super().__init__(text)
        self.processes = tuple(processes)


class SafetyTripped(DeviceError):
    """A protection took the torque of all joints off; it stays off until the actuator is resumed.

    Args:
        released: whether the device has confirmed that.
    """

    def __init__(self, text: str, *, released: bool = True) -> None:
        super().__init__(text)
        self.released = released
