"""What can go wrong with a device; importable without numpy, for safe-stop processes."""

from __future__ import annotations

from typing import ClassVar

from joshua.node.errors import EXIT_DEVICE_REFUSED, NodeError


class DeviceError(NodeError):
    """A device is absent, refuses, or answers wrongly; the message names device and remedy."""

    exit_code: ClassVar[int] = EXIT_DEVICE_REFUSED


class DeviceDisconnected(DeviceError):
    """A device that was connected does not answer any more."""
