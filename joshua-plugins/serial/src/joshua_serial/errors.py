"""Errors of serial ports: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceBusy, DeviceDisconnected, DeviceError


class PortNotFound(DeviceError):
    """No such serial port, or no adapter of that identity."""


class PortBusy(DeviceBusy):
    """Another process has the port open."""


class PortGuarded(PortBusy):
    """The guardian of a failed driver uses the port; it ends by itself."""


class PortForbidden(DeviceError):
    """This user may not open the port."""


class PortUnusable(DeviceError):
    """The path is no serial port, or cannot run at the line speed."""


class PortDisconnected(DeviceDisconnected):
    """The adapter of the open port was unplugged."""
