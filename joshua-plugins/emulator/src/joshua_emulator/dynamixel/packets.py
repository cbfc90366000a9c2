"""Packets of protocol 2.0: ``FF FF FD 00 id length length instruction parameters… crc crc``.

From the instruction onwards, ``FF FF FD`` is followed by a stuffed ``FD``, so no packet contains a header.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum

HEADER = b"\xff\xff\xfd\x00"
BROADCAST_ID = 0xFE
OVERHEAD = 10  # bytes of an instruction packet without its parameters
LARGEST_LENGTH = 1024


class Instruction(IntEnum):
    """Instructions of the bus."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    CLEAR = 0x10
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93
    FAST_BULK_READ = 0x9A


class ProtocolError(IntEnum):
    """Error numbers of a status packet."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


ALERT = 0x80  # bit of the error byte: hardware_error is not 0


@dataclass(frozen=True)
class InstructionPacket:
    """One instruction; ``size`` is the number of bytes on the line up to its end, including noise."""

    servo_id: int
    instruction: int
    parameters: bytes
    size: int


def _crc_of(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


_CRC_OF_BYTE = tuple(map(_crc_of, range(256)))


def crc16(data: bytes) -> int:
    """CRC-16 with the polynomial 0x8005, most significant bit first, from 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC_OF_BYTE[crc >> 8 ^ byte]
    return crc


def packet(servo_id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """A packet with stuffing and CRC."""
    body = (bytes((instruction,)) + parameters).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    start = HEADER + bytes((servo_id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return start + crc16(start).to_bytes(2, "little")


def status_packet(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's reply."""
    return packet(servo_id, Instruction.STATUS, bytes((error,)) + data)


def fast_status_packet(parts: Iterable[tuple[int, int, bytes]], size: int) -> bytes:
    """Return the joint reply to a fast read: one packet, with the running CRC after each part.

    Args:
        parts: id, error and data of each servo that answers; size: data bytes of all servos that were asked.
    """
    length = 1 + size
    reply = HEADER + bytes((BROADCAST_ID,)) + length.to_bytes(2, "little") + bytes((Instruction.STATUS,))
    for servo_id, error, data in parts:
        reply += bytes((error, servo_id)) + data
        reply += crc16(reply).to_bytes(2, "little")
    return reply


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
                self._skip(max(0, len(buffer) - len(HEADER) + 1))
                return
            self._skip(start)
            if len(buffer) < 7:
                return
            length = int.from_bytes(buffer[5:7], "little")
            if not 3 <= length <= LARGEST_LENGTH:
                self._skip(1)
                continue
            size = length + 7
            if len(buffer) < size:
                return
            whole = bytes(buffer[:size])
            if crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
                self._skip(1)
                continue
            body = whole[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
            yield InstructionPacket(whole[4], body[0], body[1:], self._skipped + size)
            self._skipped = 0
            del buffer[:size]

    def _skip(self, count: int) -> None:
        del self._buffer[:count]
        self._skipped += count
