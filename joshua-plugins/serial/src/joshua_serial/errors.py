"""What can go wrong with a serial port: one class per cause, each message with its remedy."""

from __future__ import annotations

from joshua.api import DeviceBusy, DeviceDisconnected, DeviceError


class PortNotFound(DeviceError):
    """No such serial port, or no adapter of that identity."""


class PortBusy(DeviceBusy):
    """Another process has the port open."""


class PortGuarded(PortBusy):
    """The guardian of a driver that has failed has the port open; it ends by itself."""


class PortForbidden(DeviceError):
    """This user may not open the port."""


class PortUnusable(DeviceError):
    """The path is no serial port, or cannot run at the line speed."""


class PortDisconnected(DeviceDisconnected):
    """The port was open and is gone: the adapter was unplugged."""
