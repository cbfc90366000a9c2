"""Packets of the bus: ``FF FF id length instruction|error parameters… checksum``."""

from __future__ import annotations

from collections.abc import Iterator

from joshua_servo.reply import Reply
from scservo_sdk import scservo_def

PING: int = scservo_def.INST_PING
READ: int = scservo_def.INST_READ
WRITE: int = scservo_def.INST_WRITE
SYNC_READ: int = scservo_def.INST_SYNC_READ
SYNC_WRITE: int = scservo_def.INST_SYNC_WRITE
BROADCAST_ID: int = scservo_def.BROADCAST_ID
OVERHEAD = 6  # bytes of a packet without its parameters
_LARGEST_ID = 253


def request(servo_id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet."""
    body = bytes((servo_id, len(parameters) + 2, instruction)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


class Search:
    """Replies in received bytes; ``broken`` counts packets with a wrong checksum."""

    def __init__(self) -> None:
        self.broken = 0
        self.rest = b""

    def feed(self, data: bytes) -> Iterator[Reply]:
        """Add bytes and yield each complete reply, skipping noise."""
        buffer = self.rest + data
        at = 0
        while True:
            start = buffer.find(b"\xff\xff", at)
            if start < 0:
                self.rest = buffer[-1:] if buffer.endswith(b"\xff") else b""
                return
            while buffer[start + 2 : start + 3] == b"\xff":
                start += 1  # an id is never FF, so a third FF belongs to the header
            if len(buffer) < start + 4:
                self.rest = buffer[start:]
                return
            end = start + 4 + buffer[start + 3]
            if buffer[start + 2] > _LARGEST_ID or buffer[start + 3] < 2:
                self.broken += 1
                at = start + 2
            elif len(buffer) < end:
                self.rest = buffer[start:]
                return
            elif ~sum(buffer[start + 2 : end - 1]) & 0xFF != buffer[end - 1]:
                self.broken += 1
                at = start + 2
            else:
                yield Reply(buffer[start + 2], buffer[start + 4], buffer[start + 5 : end - 1])
                at = end
