"""Packets of protocol 2.0: ``FF FF FD 00 id length length instruction parameters… crc crc``.

From the instruction onwards, ``FF FF FD`` is followed by a stuffed ``FD``, so no packet contains a header.
The vendor's Python SDK computes the stuffing but sends the packet without it, so packets are built here; the
constants come from the SDK.
"""

from __future__ import annotations

from collections.abc import Iterator

from dynamixel_sdk import protocol2_packet_handler as handler
from dynamixel_sdk import robotis_def
from joshua_servo.reply import Reply

PING: int = robotis_def.INST_PING
READ: int = robotis_def.INST_READ
WRITE: int = robotis_def.INST_WRITE
REBOOT: int = robotis_def.INST_REBOOT
SYNC_READ: int = robotis_def.INST_SYNC_READ
SYNC_WRITE: int = robotis_def.INST_SYNC_WRITE
STATUS: int = robotis_def.INST_STATUS
BROADCAST_ID: int = robotis_def.BROADCAST_ID
ALERT: int = handler.ERRBIT_ALERT  # alert bit of a reply's error byte: the hardware error register is not 0

REPLY_OVERHEAD = 11  # bytes of a reply without its data
HEADER = b"\xff\xff\xfd\x00"
_LARGEST_LENGTH = 1024
_LARGEST_ID = 252
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"

#: Why a servo refuses a request, by the error number of its reply. A corrupt request is simply sent again.
REFUSALS = {
    handler.ERRNUM_RESULT_FAIL: "the servo cannot execute it in its present state; after a hardware error, "
    "reboot the servo",
    handler.ERRNUM_INSTRUCTION: "the servo does not support the instruction",
    handler.ERRNUM_DATA_RANGE: "the value is out of the register's range",
    handler.ERRNUM_DATA_LENGTH: "the value has the wrong width",
    handler.ERRNUM_DATA_LIMIT: "the value exceeds a limit stored in the servo",
    handler.ERRNUM_ACCESS: "the address is read-only, absent, or locked while torque is on",
}


def _crc_table() -> tuple[int, ...]:
    table = []
    for value in range(0, 0x10000, 0x100):
        for _ in range(8):
            value = value << 1 ^ (0x18005 if value & 0x8000 else 0)
        table.append(value)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """Return the CRC-16 of a packet, excluding its own CRC."""
    table, crc = _CRC_TABLE, 0
    for byte in data:
        crc = (crc & 0xFF) << 8 ^ table[crc >> 8 ^ byte]
    return crc


def request(servo_id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet."""
    body = bytes((instruction,)) + parameters
    if _PATTERN in body:
        body = body.replace(_PATTERN, _STUFFED)
    start = HEADER + bytes((servo_id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return start + crc16(start).to_bytes(2, "little")


def word(value: int) -> bytes:
    """Return an address or length as two bytes."""
    return value.to_bytes(2, "little")


class Search:
    """Replies in received bytes; ``broken`` counts packets with a wrong CRC."""

    def __init__(self) -> None:
        self.broken = 0
        self.rest = b""

    def feed(self, data: bytes) -> Iterator[Reply]:
        """Add bytes and yield each complete reply, skipping noise and instruction packets."""
        buffer = self.rest + data
        at = 0
        while True:
            start = buffer.find(HEADER, at)
            if start < 0:
                self.rest = buffer[max(at, len(buffer) - len(HEADER) + 1) :]
                return
            if len(buffer) < start + 8:
                self.rest = buffer[start:]
                return
            length = int.from_bytes(buffer[start + 5 : start + 7], "little")
            end = start + 7 + length
            at = start + 1
            if buffer[start + 4] > _LARGEST_ID or not 3 <= length <= _LARGEST_LENGTH:
                self.broken += 1
            elif buffer[start + 7] != STATUS:
                continue  # an instruction that the adapter echoes
            elif length < 4:
                self.broken += 1
            elif len(buffer) < end:
                self.rest = buffer[start:]
                return
            elif crc16(buffer[start : end - 2]) != int.from_bytes(buffer[end - 2 : end], "little"):
                self.broken += 1
            else:
                body = buffer[start + 8 : end - 2].replace(_STUFFED, _PATTERN)
                yield Reply(buffer[start + 4], body[0], body[1:])
                at = end
