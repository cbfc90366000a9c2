"""The Pybricks profile over Bluetooth Low Energy: identifiers, commands and events."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag

SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
COMMAND_EVENT = "c5f50002-8280-46da-89f4-6d8051e4aeef"
CAPABILITIES = "c5f50003-8280-46da-89f4-6d8051e4aeef"

RAM_HEADER = 5  # command and offset in front of each chunk
STDIN_HEADER = 1
MPY6_PROGRAMS = 1 << 1  # capability: multi-file programs of .mpy version 6


class Command(IntEnum):
    """Commands to the hub."""

    STOP_PROGRAM = 0
    START_PROGRAM = 1
    WRITE_PROGRAM_META = 3
    WRITE_USER_RAM = 4
    WRITE_STDIN = 6


class Event(IntEnum):
    """Events of the hub."""

    STATUS = 0
    STDOUT = 1


class Status(IntFlag):
    """Flags of the status event."""

    BATTERY_LOW = 1 << 0
    BATTERY_CRITICAL = 1 << 1
    BATTERY_HIGH_CURRENT = 1 << 2
    PROGRAM_RUNNING = 1 << 6
    SHUTDOWN = 1 << 7


#: Replies of a hub to a refused command.
REFUSALS = {0x13: "value not allowed", 0x80: "invalid command", 0x81: "busy"}


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a hub, in bytes."""

    max_write_size: int
    features: int
    max_program_size: int

    @classmethod
    def parse(cls, data: bytes) -> Capabilities:
        """Parse the characteristic; newer firmware appends bytes. Raises ValueError."""
        if len(data) < struct.calcsize("<HII"):
            raise ValueError(f"the hub's capabilities have {len(data)} bytes, at least 10 are expected")
        return cls(*struct.unpack_from("<HII", data))


def upload_commands(blob: bytes, max_write_size: int) -> Iterator[bytes]:
    """Return the commands that upload a program and start it, in order."""
    yield struct.pack("<BI", Command.WRITE_PROGRAM_META, 0)  # a partial program is never started
    size = max_write_size - RAM_HEADER
    for offset in range(0, len(blob), size):
        yield struct.pack("<BI", Command.WRITE_USER_RAM, offset) + blob[offset : offset + size]
    yield struct.pack("<BI", Command.WRITE_PROGRAM_META, len(blob))
    yield bytes([Command.START_PROGRAM])


def stdin_commands(line: bytes, max_write_size: int) -> Iterator[bytes]:
    """Return the commands that write a line to the program's standard input."""
    size = max_write_size - STDIN_HEADER
    for start in range(0, len(line), size):
        yield bytes([Command.WRITE_STDIN]) + line[start : start + size]
