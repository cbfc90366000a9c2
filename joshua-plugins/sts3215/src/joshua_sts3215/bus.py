"""The bus of STS3215 servos: the packets of its protocol, and the lock of its EEPROM."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from joshua_servo.bus import ServoBus
from joshua_servo.bus_tools import FoundMotor
from joshua_servo.register import Register

from joshua_sts3215.packet import (
    BROADCAST_ID,
    OVERHEAD,
    PING,
    READ,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Search,
    request,
)
from joshua_sts3215.registers import FEEDBACK, LINE_SPEEDS, LOCK, MODEL_NAMES


class Bus(ServoBus):
    """Requests to the servos on one port."""

    reply_overhead = OVERHEAD
    baudrates = LINE_SPEEDS

    def identify(self, servo_id: int) -> FoundMotor:
        """Read model, firmware and one feedback sample of a servo. Raises NoReply and PortDisconnected."""
        block = self.read_block(servo_id, 0, 5)
        self.read_block(servo_id, *FEEDBACK)
        number = int.from_bytes(block[3:5], "little")
        return FoundMotor(
            servo_id, self.port.baudrate, MODEL_NAMES.get(number, f"model {number}"), f"{block[0]}.{block[1]}"
        )

    def write_eeprom(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Unlock the EEPROM, write, read back and lock it again; a locked EEPROM silently ignores writes.

        Raises:
            NoReply: the servo did not answer, or a register did not keep its value.
            PortDisconnected: the adapter was unplugged.
        """
        self.write(servo_id, LOCK, 0)
        try:
            self.write_checked(servo_id, values)
        finally:
            self.write(servo_id, LOCK, 1)

    def read_request(self, servo_id: int, address: int, length: int) -> bytes:
        """Return the packet that reads bytes of one servo."""
        return request(servo_id, READ, bytes((address, length)))

    def write_request(self, servo_id: int, address: int, data: bytes) -> bytes:
        """Return the packet that writes bytes of one servo."""
        return request(servo_id, WRITE, bytes((address,)) + data)

    def ping_request(self, servo_id: int) -> bytes:
        """Return the packet that pings a servo."""
        return request(servo_id, PING)

    def sync_read_request(self, address: int, length: int, ids: Sequence[int]) -> bytes:
        """Return the packet that reads the same bytes of several servos."""
        return request(BROADCAST_ID, SYNC_READ, bytes((address, length, *ids)))

    def sync_write_request(self, address: int, width: int, rows: Mapping[int, bytes]) -> bytes:
        """Return the packet that writes the same bytes of several servos."""
        parameters = bytearray((address, width))
        for servo_id, data in rows.items():
            parameters.append(servo_id)
            parameters += data
        return request(BROADCAST_ID, SYNC_WRITE, bytes(parameters))

    def take_all(self, received: bytes, size: int, ids: Sequence[int]) -> dict[int, bytes] | None:
        """Return all replies of a sync read if each is complete and in place, else None."""
        step = size + OVERHEAD
        if len(received) != step * len(ids):
            return None
        values = {}
        at = 0
        status = self.status
        for servo_id in ids:
            end = at + step
            body = received[at + 2 : end - 1]
            if (
                received[at : at + 2] != b"\xff\xff"
                or body[0] != servo_id
                or body[1] != size + 2
                or ~sum(body) & 0xFF != received[end - 1]
            ):
                return None
            status[servo_id] = body[2]
            values[servo_id] = body[3:]
            at = end
        return values

    def make_search(self) -> Search:
        """Return a parser that finds replies in received bytes."""
        return Search()
