"""Interface of an emulated servo to its bus and the control channel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from joshua_emulator.joint import Drive, Joint
from joshua_emulator.servo_bus.registers import Register

RETURN_DELAY_UNIT_S = 2e-6

OnEeprom = Callable[[bytes], None]
OnTorque = Callable[[Any, bool, float], None]


@dataclass
class Supply:
    """The power supply that the servos of a bus share."""

    volts: float = 12.0


class EmulatedServo(ABC):
    """One servo of a bus: its memory and the joint that it moves.

    Args:
        on_eeprom: called with the new contents of the EEPROM after each change.
        on_torque: called with (servo, energised, time in s) when torque turns on or off.

    Attributes:
        joint: what it moves; supply: what feeds it.
        silent, silent_until_s: does not reply, at all or until a monotonic time.
    """

    #: Registers by name.
    registers: ClassVar[Mapping[str, Register]]
    #: Those that the control channel's ``state`` shows.
    state_names: ClassVar[tuple[str, ...]]
    #: Address of the id; the code of the line speed and the return delay follow.
    id_address: ClassVar[int]
    #: Line speeds by their code.
    baudrates: ClassVar[Mapping[int, int]]
    #: First address of the EEPROM and the one behind its last.
    eeprom_span: ClassVar[tuple[int, int]]

    def __init__(
        self, joint: Joint, supply: Supply, memory: bytearray, on_eeprom: OnEeprom, on_torque: OnTorque
    ) -> None:
        self.joint = joint
        self.supply = supply
        self.memory = memory
        self.silent = False
        self.silent_until_s = 0.0
        self.pending: tuple[int, bytes] | None = None  # a write that waits for its action
        self._on_eeprom = on_eeprom
        self._on_torque = on_torque
        self._drive = Drive()
        self._time_s: float | None = None
        self._energised = False

    def get(self, name: str) -> int:
        """Value of a register by name, sign applied; feedback as of the last ``advance``."""
        register = self.registers[name]
        raw = int.from_bytes(self.memory[register.address : register.address + register.width], "little")
        return register.decode(raw)

    def put(self, name: str, value: int) -> None:
        """Set a register from inside the servo: no lock, no range, no side effect."""
        register = self.registers[name]
        raw = register.encode(value).to_bytes(register.width, "little")
        self.memory[register.address : register.address + register.width] = raw

    def angle_of(self, position: float) -> float:
        """Return the nearest shaft angle that reads as a position in ticks."""
        return self.joint.angle + (position - self.present())

    @property
    def servo_id(self) -> int:
        """Id on the bus."""
        return self.memory[self.id_address]

    @property
    def baudrate(self) -> int:
        """Line speed that the servo listens at, bit/s."""
        return self.baudrates[self.memory[self.id_address + 1]]

    @property
    def return_delay_s(self) -> float:
        """Time between the end of a request and the start of the reply."""
        return self.memory[self.id_address + 2] * RETURN_DELAY_UNIT_S

    @property
    def energised(self) -> bool:
        """Whether the motor has power; a tripped protection may take it off while torque_enable stays 1."""
        return self._energised

    @property
    def eeprom(self) -> bytes:
        """Contents of the EEPROM."""
        start, end = self.eeprom_span
        return bytes(self.memory[start:end])

    @eeprom.setter
    def eeprom(self, contents: bytes) -> None:
        start, end = self.eeprom_span
        self.memory[start:end] = contents[: end - start]

    @property
    @abstractmethod
    def status(self) -> int:
        """Status bits."""

    @property
    @abstractmethod
    def low_volts(self) -> float:
        """Supply voltage below which the servo reports undervoltage."""

    @abstractmethod
    def present(self) -> int:
        """Present position in ticks, as the host reads it."""

    def advance(self, now_s: float) -> None:
        """Advance joint, protections and feedback registers to a monotonic time."""
        if self._time_s is None:
            self._time_s = now_s
        elapsed_s = max(0.0, now_s - self._time_s)
        self._time_s = max(self._time_s, now_s)
        self.joint.advance(now_s, self._drive)
        self._protect(elapsed_s)
        self._measure()

    @abstractmethod
    def _protect(self, elapsed_s: float) -> None:
        """Check temperature, load and voltage after a period."""

    @abstractmethod
    def _measure(self) -> None:
        """Fill the feedback registers."""

    def _set_drive(self, drive: Drive | None, now_s: float) -> None:
        """Set the motor command; None disables torque."""
        self._drive = Drive() if drive is None else drive
        energised = drive is not None
        if energised != self._energised:
            self._energised = energised
            self._on_torque(self, energised, now_s)

    @abstractmethod
    def power_on(self, now_s: float | None = None) -> None:
        """Restart as after a power cut.

        Args:
            now_s: when power returned; the servo does not reply for a short time afterwards.
        """

    @abstractmethod
    def overload(self, now_s: float) -> None:
        """Trip the overload protection."""

    @abstractmethod
    def calibration(self) -> dict[str, Any]:
        """``homing_offset``, ``range_min`` and ``range_max`` as a calibration block has them."""
