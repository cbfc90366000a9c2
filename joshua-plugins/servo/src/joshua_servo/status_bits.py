"""Meaning of the bits in a servo's status."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class StatusBits:
    """Bits of a status register.

    Attributes:
        names: words for each bit.
        voltage: the bit of a supply out of range, which may be set briefly.
        overload: the bit of an overload.
    """

    names: Mapping[int, str]
    voltage: int
    overload: int

    @property
    def known(self) -> int:
        """All defined bits."""
        return sum(self.names)

    @property
    def at_once(self) -> int:
        """Bits that disable the torque immediately."""
        return self.known & ~self.voltage

    def describe(self, bits: int) -> str:
        """Names of the set bits, "" if none is set."""
        names = [name for bit, name in self.names.items() if bits & bit]
        unknown = bits & ~self.known
        return ", ".join([*names, *([f"unknown bits 0x{unknown:02x}"] if unknown else [])])
