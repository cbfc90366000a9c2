"""Registers of an emulated servo as data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Area(Enum):
    """Memory area of a register, which determines write access and persistence."""

    VERSION = "version"  # read-only
    EEPROM = "eeprom"  # kept without power; a lock keeps it from being written
    RAM = "ram"  # back to its default at power-on
    FEEDBACK = "feedback"  # read-only, measured
    FACTORY = "factory"  # read-only constants


@dataclass(frozen=True)
class Register:
    """One register, least significant byte first.

    Attributes:
        sign_bit: the bit of a sign-magnitude value; None if there is none.
        signed: the value is a two's complement.
    """

    name: str
    address: int
    width: int
    area: Area
    default: int = 0
    minimum: int = 0
    maximum: int = 0xFFFF
    sign_bit: int | None = None
    signed: bool = False

    def decode(self, raw: int) -> int:
        """The signed value behind raw register bits."""
        if self.signed:
            bits = 8 * self.width
            return raw - (1 << bits) if raw >> (bits - 1) & 1 else raw
        if self.sign_bit is None or not raw >> self.sign_bit & 1:
            return raw
        return -(raw & ((1 << self.sign_bit) - 1))

    def encode(self, value: int) -> int:
        """Raw register bits of a signed value."""
        if self.signed:
            return value & ((1 << 8 * self.width) - 1)
        if self.sign_bit is None:
            return value
        return abs(value) | ((value < 0) << self.sign_bit)
