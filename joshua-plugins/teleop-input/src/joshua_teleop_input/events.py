"""``struct input_event``, the kernel's record of an input device."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

#: Seconds, microseconds, type, code, value; the layout of 64-bit Linux, little-endian.
RECORD = struct.Struct("<qqHHi")

#: The native layout of this machine, for devices of its own kernel.
NATIVE_RECORD = struct.Struct("llHHi")


@dataclass(frozen=True)
class AxisRange:
    """Data of an axis (``struct input_absinfo``): present value, limits, noise, centre."""

    value: int
    minimum: int
    maximum: int
    fuzz: int = 0
    flat: int = 0
    resolution: int = 0


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a device and its present state.

    Attributes:
        name: reported by the device; identity: bus, vendor, product, version.
        keys: codes of its buttons; held: codes of the pressed buttons; axes: by code.
    """

    name: str
    identity: tuple[int, ...] = (0, 0, 0, 0)
    keys: frozenset[int] = frozenset()
    held: frozenset[int] = frozenset()
    axes: Mapping[int, AxisRange] = field(default_factory=dict)

    @property
    def vendor(self) -> int:
        """Vendor id."""
        return self.identity[1] if len(self.identity) > 1 else 0

    @property
    def product(self) -> int:
        """Product id."""
        return self.identity[2] if len(self.identity) > 2 else 0


@dataclass(frozen=True)
class InputEvent:
    """One record without its timestamp."""

    type: int
    code: int
    value: int


class EventDecoder:
    """Splits a byte stream into records; an incomplete record waits for the rest."""

    def __init__(self, record: struct.Struct = RECORD) -> None:
        self._record = record
        self._rest = b""

    def feed(self, data: bytes) -> list[InputEvent]:
        """Add bytes; return the records that they complete."""
        data = self._rest + data
        size = self._record.size
        whole = len(data) - len(data) % size
        self._rest = data[whole:]
        return [InputEvent(*record[2:]) for record in self._record.iter_unpack(data[:whole])]
