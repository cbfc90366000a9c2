"""One register of a servo, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Register:
    """One register, least significant byte first.

    Attributes:
        width: bytes.
        sign_bit: the sign bit of a sign-magnitude value; None if there is none.
        signed: the value is a two's complement.
        eeprom: it is persistent, and a lock protects it from writes.
    """

    name: str
    address: int
    width: int
    sign_bit: int | None = None
    eeprom: bool = False
    signed: bool = False

    @property
    def end(self) -> int:
        """Address after the register."""
        return self.address + self.width

    def decode(self, data: bytes) -> int:
        """Value of the register's bytes."""
        raw = int.from_bytes(data[: self.width], "little", signed=self.signed)
        if self.sign_bit is None or not raw >> self.sign_bit & 1:
            return raw
        return -(raw & ((1 << self.sign_bit) - 1))

    def encode(self, value: int) -> bytes:
        """Bytes of a value. Raises ValueError if it is out of range."""
        lowest, highest = self._bounds()
        if not lowest <= value <= highest:
            raise ValueError(f"{self.name} accepts {lowest} to {highest}, found {value}")
        if self.sign_bit is not None:
            value = abs(value) | (value < 0) << self.sign_bit
        return value.to_bytes(self.width, "little", signed=self.signed)

    def _bounds(self) -> tuple[int, int]:
        if self.sign_bit is not None:
            largest = (1 << self.sign_bit) - 1
            return -largest, largest
        bits = 8 * self.width - self.signed
        return -(1 << bits) if self.signed else 0, (1 << bits) - 1
