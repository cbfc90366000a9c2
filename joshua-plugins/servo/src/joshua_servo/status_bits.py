"""What the bits of a servo's status mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class StatusBits:
    """Bits of a status register.

    Attributes:
        names: words for each bit.
        voltage: the bit of a supply out of range, which may come and go for a moment.
        overload: the bit of an overload.
    """

    names: Mapping[int, str]
    voltage: int
    overload: int

    @property
    def known(self) -> int:
        """All bits that have a meaning."""
        return sum(self.names)

    @property
    def at_once(self) -> int:
        """Bits that take the torque off as soon as they are seen."""
        return self.known & ~self.voltage

    def describe(self, bits: int) -> str:
        """Name of the set bits, "" if none is set."""
        names = [name for bit, name in self.names.items() if bits & bit]
        unknown = bits & ~self.known
        return ", ".join([*names, *([f"unknown bits 0x{unknown:02x}"] if unknown else [])])
