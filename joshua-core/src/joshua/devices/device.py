"""What actuators and sensors have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod

from joshua.devices.errors import DeviceError


class Device(ABC):
    """A device that is open between ``connect`` and ``disconnect``."""

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether the device is open."""

    @abstractmethod
    def connect(self) -> None:
        """Opens the device and checks it; the torque of joints stays as it is. Raises DeviceError."""

    @abstractmethod
    def disconnect(self) -> None:
        """Closes the device; a second call does nothing."""

    def require_connected(self, verb: str) -> None:
        """Refuses a call that needs an open device, such as ``read``. Raises DeviceError."""
        if not self.connected:
            raise DeviceError(f"{type(self).__name__}.{verb}: the device is not open: call connect first")
