"""Packets on the wire: ``FF FF id length instruction parameters… checksum``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

HEADER = b"\xff\xff"
BROADCAST_ID = 0xFE
SMALLEST_PACKET = 6


class Instruction(IntEnum):
    """Instructions of the bus."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    RESTORE = 0x06  # factory settings, except the id
    REBOOT = 0x08
    RESET = 0x0A  # working state as after power-on
    OFFSET_CALIBRATION = 0x0B  # the present position becomes 2048, or the value of the parameters
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


@dataclass(frozen=True)
class InstructionPacket:
    """One instruction; ``size`` is the number of bytes on the line up to its end, including noise."""

    servo_id: int
    instruction: int
    parameters: bytes
    size: int


def checksum(body: bytes) -> int:
    """Checksum over id, length, instruction or error, and parameters."""
    return ~sum(body) & 0xFF


def status_packet(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's reply."""
    body = bytes((servo_id, len(data) + 2, error)) + data
    return HEADER + body + bytes((checksum(body),))


class InstructionParser:
    """Finds instruction packets in received bytes; skips noise and corrupt packets."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._skipped = 0

    def clear(self) -> None:
        """Discard a partial packet."""
        self._buffer.clear()
        self._skipped = 0

    def feed(self, data: bytes) -> Iterator[InstructionPacket]:
        """Add bytes and yield each complete packet."""
        buffer = self._buffer
        buffer += data
        while True:
            start = buffer.find(HEADER)
            if start < 0:
                keep = 1 if buffer.endswith(b"\xff") else 0
                self._skip(len(buffer) - keep)
                return
            while len(buffer) > start + 2 and buffer[start + 2] == 0xFF:
                start += 1  # an id is never FF, so a third FF belongs to the header
            self._skip(start)
            if len(buffer) < 4:
                return
            length = buffer[3]
            if length < 2:
                self._skip(2)
                continue
            size = length + 4
            if len(buffer) < size:
                return
            body = bytes(buffer[2 : size - 1])
            if checksum(body) != buffer[size - 1]:
                self._skip(2)
                continue
            yield InstructionPacket(body[0], body[2], body[3:], self._skipped + size)
            self._skipped = 0
            del buffer[:size]

    def _skip(self, count: int) -> None:
        del self._buffer[:count]
        self._skipped += count
