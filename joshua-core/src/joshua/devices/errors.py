"""Errors of devices. Importable without numpy, for safe-stop processes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from joshua.node.errors import EXIT_DEVICE_REFUSED, EXIT_FILE_WRONG, NodeError


class DeviceError(NodeError):
    """A device is absent, refuses, or sends a wrong reply. The message names the device and the remedy."""

    exit_code: ClassVar[int] = EXIT_DEVICE_REFUSED


class ConfigurationError(DeviceError):
    """What the configuration names is absent or malformed: a model, a joint, a camera, a recording.

    No device can mend that, so a restart is not tried. The message says what the file must say.
    """

    exit_code: ClassVar[int] = EXIT_FILE_WRONG
    is_permanent = True


class DeviceDisconnected(DeviceError):
    """A connected device has stopped responding."""


class DeviceSilent(DeviceDisconnected):
    """A connected device did not reply in time. It may reply again soon."""


class DeviceBusy(DeviceError):
    """Another process uses the device.

    Args:
        processes: ids of the processes that use it, as far as known.
    """

    def __init__(self, text: str, *, processes: Sequence[int] = ()) -> None:
        super().__init__(text)
        self.processes = tuple(processes)


class SafetyTripped(DeviceError):
    """A protection switched the torque of all joints off. It stays off until the actuator is resumed.

    Args:
        released: whether the device has confirmed that.
    """

    def __init__(self, text: str, *, released: bool = True) -> None:
        super().__init__(text)
        self.released = released
