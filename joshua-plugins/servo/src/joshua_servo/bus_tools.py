"""What can be done with a bus of motors outside a run: find what is on it, and give a motor its id.

A driver's plugin names its class by ``ActuatorSpec.bus_tools``; `joshua find-port`, `joshua motors` and
`joshua doctor` work with every class that is named there. No method moves a motor or switches torque on.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import ClassVar

from joshua.api import DeviceError
from joshua_serial.found_motor import FoundMotor as FoundMotor
from joshua_serial.port import SerialPort


class AssignmentFailed(DeviceError):
    """A motor did not take its id or line speed; the message says what it answers to now."""


class BusTools(ABC):
    """Motors of one family on one open port. The port's line speed is put back after every method.

    Attributes:
        family: what the motors are called, such as ``STS3215 servos``.
        baudrates: line speeds that the motors can have, bit/s, the usual one first.
        ids: ids that a motor can be given.
        expected_models: names of the models that the driver can drive.
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
        """Look for motors; yield each as it is found, by line speed, then by id.

        Writes nothing. Speeds that the adapter cannot run at are passed over.

        Args:
            baudrates: line speeds to look at, in this order; () for all that the motors can have.

        Raises:
            PortDisconnected: the adapter was unplugged.
        """

    @abstractmethod
    def assign(self, motor: FoundMotor, motor_id: int, baudrate: int) -> FoundMotor:
        """Give one motor its id and line speed, and the factory's way of working; take torque off it.

        All or nothing: every value is read back, and after a failure the former id and line speed are put
        back as far as the motor answers. Nothing is written where another motor has the id already.

        Args:
            motor: as ``scan`` found it.
            motor_id, baudrate: what it is to have from now on.

        Returns:
            The motor as it answers afterwards.

        Raises:
            AssignmentFailed: it did not take the values, or the id is taken.
            PortDisconnected: the adapter was unplugged meanwhile.
        """
