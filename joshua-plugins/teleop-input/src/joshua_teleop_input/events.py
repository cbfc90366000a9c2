"""``struct input_event``: the kernel's records of an input device."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

#: Seconds, microseconds, type, code, value; the layout of 64-bit Linux, little-endian.
RECORD = struct.Struct("<qqHHi")

#: The layout of the machine that this program runs on, for the devices of its own kernel.
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
        name: as the device calls itself; identity: bus, vendor, product, version.
        keys: codes of its buttons; held: those that are pressed; axes: by code.
    """

    name: str
    identity: tuple[int, ...] = (0, 0, 0, 0)
    keys: frozenset[int] = frozenset()
    held: frozenset[int] = frozenset()
    axes: Mapping[int, AxisRange] = field(default_factory=dict)

    @property
    def vendor(self) -> int:
        """Number of the maker."""
        return self.identity[1] if len(self.identity) > 1 else 0

    @property
    def product(self) -> int:
        """The maker's number of the model."""
        return self.identity[2] if len(self.identity) > 2 else 0


@dataclass(frozen=True)
class InputEvent:
    """One record without its time."""

    type: int
    code: int
    value: int


class EventDecoder:
    """Cuts a byte stream into records; a record that is not whole waits for its rest."""

    def __init__(self, record: struct.Struct = RECORD) -> None:
        self._record = record
        self._rest = b""

    def feed(self, data: bytes) -> list[InputEvent]:
        """Take bytes; return the records that they complete."""
        data = self._rest + data
        size = self._record.size
        whole = len(data) - len(data) % size
        self._rest = data[whole:]
        return [InputEvent(*record[2:]) for record in self._record.iter_unpack(data[:whole])]
