"""Tools for a bus of motors outside a run: find its motors, and assign an id to a motor.

A driver's plugin names its class by ``ActuatorSpec.bus_tools``; `joshua find-port`, `joshua motors` and
`joshua doctor` use all these classes. No method moves a motor or enables torque.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import ClassVar

from joshua.api import DeviceError
from joshua_serial.found_motor import FoundMotor as FoundMotor
from joshua_serial.port import SerialPort


class AssignmentFailed(DeviceError):
    """A motor did not accept its id or line speed. The message states its present ones."""


class BusTools(ABC):
    """Motors of one family on one open port. Every method restores the port's line speed.

    Attributes:
        family: name of the motors, such as ``STS3215 servos``.
        baudrates: supported line speeds, bit/s, the most common first.
        ids: valid ids.
        expected_models: names of the models that the driver supports.
        factory_id: id of a new motor.
    """

    family: ClassVar[str]
    baudrates: ClassVar[tuple[int, ...]]
    ids: ClassVar[range]
    expected_models: ClassVar[tuple[str, ...]]
    factory_id: ClassVar[int] = 1

    def __init__(self, port: SerialPort) -> None:
        self.port = port

    @abstractmethod
    def scan(self, baudrates: Sequence[int] = ()) -> Iterator[FoundMotor]:
        """Search for motors. Yield each immediately, by line speed, then by id.

        Writes nothing. Skips speeds that the adapter does not support.

        Args:
            baudrates: line speeds to search, in this order; () for all supported ones.

        Raises:
            PortDisconnected: the adapter was unplugged.
        """

    @abstractmethod
    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        """Set id and line speed of one motor, restore its factory working mode, and disable its torque.

        All or nothing: every value is read back. After a failure, the old id and line speed are restored, if
        the motor replies. Nothing is written if another motor already has the id.

        Args:
            motor: a result of ``scan``.
            motor_id, baudrate: new values.

        Returns:
            The motor with its new values.

        Raises:
            AssignmentFailed: it did not accept the values, or the id is in use.
            PortDisconnected: the adapter was unplugged meanwhile.
        """
