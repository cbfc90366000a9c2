"""The settings of both devices; ranges and defaults stand in the proto file."""

from joshua.api import ActuatorSettings, JointRange
from joshua_serial.port import SerialPort
from joshua_serial.settings import SerialSettings
from joshua_serial.usb_ports import Endpoint


class RangeSettings(SerialSettings):
    """Settings of the range finder."""

    max_m: float

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages."""
        return "a range finder"


class ClampSettings(SerialSettings, ActuatorSettings):
    """Settings of the clamp."""

    opening_rad: float

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages."""
        return "a clamp"

    def joints(self) -> tuple[JointRange, ...]:
        """The joint and its limits."""
        return (JointRange("clamp", 0.0, self.opening_rad),)


def port_of(settings: SerialSettings) -> SerialPort:
    """Return the port of a device, closed: the constructor of a driver opens nothing."""
    endpoint = Endpoint(settings.port, settings.serial_number, settings.vid_pid, settings.device_root)
    return SerialPort(endpoint, settings.baudrate)
