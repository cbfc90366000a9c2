"""The bus of X-series servos: packets of protocol 2.0, and the reboot."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from joshua.api.patience import AwakeClock
from joshua_servo.bus import ServoBus
from joshua_servo.bus_tools import FoundMotor
from joshua_servo.errors import NoReply

from joshua_dynamixel.models import model_name
from joshua_dynamixel.packet import (
    ALERT,
    BROADCAST_ID,
    HEADER,
    PING,
    READ,
    REBOOT,
    REFUSALS,
    REPLY_OVERHEAD,
    STATUS,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Search,
    crc16,
    request,
    word,
)
from joshua_dynamixel.registers import BAUDRATES, FEEDBACK, FIRMWARE, MODEL, SETUP, SPANS

REBOOT_TIMEOUT_S = 2.0
_REBOOT_PAUSE_S = 0.05


class Bus(ServoBus):
    """Requests to the servos on one port."""

    refuses = True
    reply_overhead = REPLY_OVERHEAD
    baudrates = tuple(BAUDRATES.values())

    def identify(self, servo_id: int) -> FoundMotor:
        """Read model, firmware and one feedback sample of a servo. Raises NoReply and PortDisconnected."""
        block = self.read_block(servo_id, 0, FIRMWARE.end)
        self.read_block(servo_id, *FEEDBACK)
        firmware = FIRMWARE.decode(block[FIRMWARE.address :])
        return FoundMotor(servo_id, self.port.baudrate, model_name(MODEL.decode(block)), str(firmware))

    def alerted(self, ids: Sequence[int]) -> tuple[int, ...]:
        """Ids of the servos whose last reply set the hardware alert bit."""
        status = self.status
        return tuple(servo_id for servo_id in ids if status.get(servo_id, 0) & ALERT)

    def read_setups(self, ids: Sequence[int]) -> dict[int, bytes]:
        """Read the settings of servos in their memory layout; servos that do not reply are left out.

        Raises PortDisconnected.
        """
        memories = {servo_id: bytearray(sum(SETUP[-1])) for servo_id in ids}
        for address, length in SETUP:
            found = self.sync_read(address, length, tuple(memories))
            memories = {servo_id: memories[servo_id] for servo_id in found}
            for servo_id, block in found.items():
                memories[servo_id][address : address + length] = block
        return {servo_id: bytes(memory) for servo_id, memory in memories.items()}

    def reboot(self, ids: Sequence[int]) -> None:
        """Reboot servos together and wait for them; clears hardware errors and leaves torque off.

        Raises NoReply and PortDisconnected.
        """
        for servo_id in ids:
            self.ask(servo_id, request(servo_id, REBOOT), 0)
        clock = AwakeClock()
        deadline_s = clock.now_s() + REBOOT_TIMEOUT_S
        time.sleep(_REBOOT_PAUSE_S)
        for servo_id in ids:
            while not self.ping(servo_id):
                if clock.now_s() > deadline_s:
                    raise NoReply(
                        f"{self.port}: id {servo_id} does not reply after a reboot. "
                        "Check its cable and the supply."
                    )

    def read_request(self, servo_id: int, address: int, length: int) -> bytes:
        """Return the packet that reads bytes of one servo."""
        return request(servo_id, READ, word(address) + word(length))

    def write_request(self, servo_id: int, address: int, data: bytes) -> bytes:
        """Return the packet that writes bytes of one servo."""
        return request(servo_id, WRITE, word(address) + data)

    def ping_request(self, servo_id: int) -> bytes:
        """Return the packet that pings a servo."""
        return request(servo_id, PING)

    def ping_length(self) -> int:
        """Return the number of data bytes in a ping reply (model and firmware)."""
        return 3

    def sync_read_request(self, address: int, length: int, ids: Sequence[int]) -> bytes:
        """Return the packet that reads the same bytes of several servos."""
        return request(BROADCAST_ID, SYNC_READ, word(address) + word(length) + bytes(ids))

    def sync_write_request(self, address: int, width: int, rows: Mapping[int, bytes]) -> bytes:
        """Return the packet that writes the same bytes of several servos."""
        parameters = bytearray(word(address) + word(width))
        for servo_id, data in rows.items():
            parameters.append(servo_id)
            parameters += data
        return request(BROADCAST_ID, SYNC_WRITE, bytes(parameters))

    def padded(self, address: int, length: int, padding: int) -> tuple[int, int, int]:
        """Extend a range by neighbouring bytes, as far as registers exist."""
        spans = (span for span in SPANS if span[0] <= address < span[1])
        first, end = next(spans, (address, address + length))
        front = min(padding, address - first)
        behind = max(0, min(padding - front, end - address - length))
        return address - front, front + length + behind, front

    def refusal(self, error: int) -> str:
        """Return why a servo refused a request, by the error number of its reply."""
        return REFUSALS.get(error & ~ALERT, "")

    def take_all(self, received: bytes, size: int, ids: Sequence[int]) -> dict[int, bytes] | None:
        """Return all replies of a sync read if each is complete, in place and unstuffed, else None."""
        step = size + REPLY_OVERHEAD
        if len(received) != step * len(ids):
            return None
        length = word(size + 4)
        values = {}
        at = 0
        for servo_id in ids:
            end = at + step
            head = received[at : at + 8]
            if (
                head != HEADER + bytes((servo_id,)) + length + bytes((STATUS,))
                or crc16(received[at : end - 2]) != received[end - 2] | received[end - 1] << 8
                or received[at + 8] & ~ALERT
            ):
                return None
            self.status[servo_id] = received[at + 8]
            values[servo_id] = received[at + 9 : end - 2]
            at = end
        return values

    def make_search(self) -> Search:
        """Return a parser that finds replies in received bytes."""
        return Search()
