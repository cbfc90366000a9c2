"""What an emulated servo is to its bus and to the control channel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.registers import Register


@dataclass
class Supply:
    """The power supply that the servos of a bus share."""

    volts: float = 12.0


class EmulatedServo(ABC):
    """One servo of a bus: its memory and the joint that it moves.

    Attributes:
        joint: what it moves; supply: what feeds it.
        silent, silent_until_s: it does not answer, at all or until a time of the monotonic clock.
    """

    #: Registers by name.
    registers: ClassVar[Mapping[str, Register]]
    #: Those that the control channel's ``state`` shows.
    state_names: ClassVar[tuple[str, ...]]

    def __init__(self, joint: Joint, supply: Supply, memory: bytearray) -> None:
        self.joint = joint
        self.supply = supply
        self.memory = memory
        self.silent = False
        self.silent_until_s = 0.0

    def get(self, name: str) -> int:
        """Value of a register by name, sign applied; feedback as of the last ``advance``."""
        register = self.registers[name]
        raw = int.from_bytes(self.memory[register.address : register.address + register.width], "little")
        return register.decode(raw)

    def put(self, name: str, value: int) -> None:
        """Sets a register from inside the servo: no lock, no range, no side effect."""
        register = self.registers[name]
        raw = register.encode(value).to_bytes(register.width, "little")
        self.memory[register.address : register.address + register.width] = raw

    def angle_of(self, position: float) -> float:
        """Shaft angle nearest to the present one that shows as a position in ticks."""
        return self.joint.angle + (position - self.present())

    @property
    @abstractmethod
    def servo_id(self) -> int:
        """Id on the bus."""

    @property
    @abstractmethod
    def baudrate(self) -> int:
        """Line speed that the servo listens at, bit/s."""

    @property
    @abstractmethod
    def return_delay_s(self) -> float:
        """Time between the end of a request and the start of the reply."""

    @property
    @abstractmethod
    def energised(self) -> bool:
        """Whether the motor has power."""

    @property
    @abstractmethod
    def status(self) -> int:
        """Status bits."""

    @property
    @abstractmethod
    def low_volts(self) -> float:
        """Supply voltage that the servo is too weak at."""

    @abstractmethod
    def present(self) -> int:
        """Present position in ticks, as the host reads it."""

    @abstractmethod
    def advance(self, now_s: float) -> None:
        """Brings joint, protections and feedback registers to a time of the monotonic clock."""

    @abstractmethod
    def power_on(self, now_s: float | None = None) -> None:
        """Starts as after a power cut.

        Args:
            now_s: when power came back; the servo is silent for a moment from then on.
        """

    @abstractmethod
    def overload(self, now_s: float) -> None:
        """Trips the overload protection."""

    @abstractmethod
    def calibration(self) -> dict[str, Any]:
        """``homing_offset``, ``range_min`` and ``range_max`` as a calibration block has them."""
