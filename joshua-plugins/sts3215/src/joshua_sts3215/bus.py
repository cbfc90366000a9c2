"""The bus: requests out, replies in, matched by id, length, order and checksum. This is the hot path.

A reply carries no number of its request, so a late one could pass for an answer to the next. Three rules keep
it out: received bytes are dropped before each request; the replies of a sync read must come in the order of
the request, each once, or none of them is believed; and after a lost reply requests ask for a varying number
of further bytes for a while, so that a late reply has the wrong length.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from joshua.devices.serial_port import SerialPort
from joshua.devices.servo.errors import NoReply

from joshua_sts3215.packet import (
    BROADCAST_ID,
    OVERHEAD,
    PING,
    READ,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Reply,
    Search,
    request,
)
from joshua_sts3215.registers import LOCK, Register

REPLY_MARGIN_S = 0.02  # beyond wire time: adapters hold bytes back for up to 16 ms
RETRIES = 4  # with the margin a tenth of a second: a busy host may stand still for that long
LATE_HORIZON_S = 0.25  # how long after a lost reply a late one is reckoned with
PADDINGS = 15
_LISTEN_BYTES = 255


@dataclass
class BusCounters:
    """What happened on the bus since it was opened; ``lost`` counts by servo id."""

    requests: int = 0
    retries: int = 0
    corrupt: int = 0
    stale: int = 0
    lost: dict[int, int] = field(default_factory=dict)

    def lose(self, servo_id: int) -> None:
        """Counts a reply that did not come."""
        self.lost[servo_id] = self.lost.get(servo_id, 0) + 1


class Bus:
    """Requests to the servos on one port.

    Args:
        reply_margin_s: how long after its wire time a reply may come.
        retries: how often a request is repeated for servos that did not answer.
    """

    def __init__(
        self, port: SerialPort, *, reply_margin_s: float = REPLY_MARGIN_S, retries: int = RETRIES
    ) -> None:
        self.port = port
        self.reply_margin_s = reply_margin_s
        self.retries = retries
        self.counters = BusCounters()
        self.status: dict[int, int] = {}  # error byte of each servo's last reply
        self._echo = 0  # 1 where the adapter returns what is sent
        self._padding = 0
        self._uncertain_until_s = 0.0
        self._requests: dict[tuple[int, int, tuple[int, ...]], bytes] = {}

    def sync_read(self, address: int, length: int, ids: tuple[int, ...]) -> dict[int, bytes]:
        """Reads the same bytes of several servos; those that do not answer within all retries are left out.

        Raises PortDisconnected.
        """
        values = self._sync_read_once(address, length, ids)
        for _ in range(self.retries):
            if len(values) == len(ids):
                break
            self.counters.retries += 1
            missing = tuple(servo_id for servo_id in ids if servo_id not in values)
            values |= self._sync_read_once(address, length, missing)
        return values

    def sync_write(self, address: int, width: int, rows: Mapping[int, bytes]) -> None:
        """Writes ``width`` bytes to several servos at once; nobody answers. Raises PortDisconnected."""
        parameters = bytearray((address, width))
        for servo_id, data in rows.items():
            parameters.append(servo_id)
            parameters += data
        self.counters.requests += 1
        self.port.send(request(BROADCAST_ID, SYNC_WRITE, bytes(parameters)))

    def read(self, servo_id: int, register: Register) -> int:
        """Reads one register. Raises NoReply and PortDisconnected."""
        return register.decode(self.read_block(servo_id, register.address, register.width))

    def read_block(self, servo_id: int, address: int, length: int) -> bytes:
        """Reads bytes of one servo. Raises NoReply and PortDisconnected."""
        for attempt in range(self.retries + 1):
            self.counters.retries += attempt > 0
            size = length + self._next_padding()
            reply = self._ask(servo_id, READ, bytes((address, size)), size)
            if reply is not None:
                return reply.data[:length]
        raise self._no_reply(servo_id, "a read")

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Writes one register and waits for the acknowledgement. Raises NoReply and PortDisconnected."""
        data = bytes((register.address,)) + register.encode(value)
        for attempt in range(self.retries + 1):
            self.counters.retries += attempt > 0
            if self._ask(servo_id, WRITE, data, 0) is not None:
                return
        raise self._no_reply(servo_id, f"a write of {register.name}")

    def write_eeprom(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Unlocks, writes, reads back and locks; a locked EEPROM drops writes without a word.

        Raises:
            NoReply: the servo did not answer, or a register did not keep its value.
            PortDisconnected: the port is gone.
        """
        self.write(servo_id, LOCK, 0)
        try:
            for register, value in values.items():
                self.write(servo_id, register, value)
                kept = self.read(servo_id, register)
                if kept != value:
                    raise NoReply(
                        f"{self.port}: id {servo_id} keeps {register.name} at {kept} instead of {value}. "
                        "Check the supply voltage and try again; the servo may be worn out."
                    )
        finally:
            self.write(servo_id, LOCK, 1)

    def ping(self, servo_id: int) -> bool:
        """Whether a servo answers, in one attempt. Raises PortDisconnected."""
        return self._ask(servo_id, PING, b"", 0) is not None

    def try_write(self, servo_id: int, register: Register, value: int) -> bool:
        """Writes one register, in one attempt; whether it was acknowledged. Raises PortDisconnected."""
        data = bytes((register.address,)) + register.encode(value)
        return self._ask(servo_id, WRITE, data, 0) is not None

    def call_all(self, quiet_s: float) -> tuple[list[int], bool]:
        """Pings everybody at once, in one attempt; listens until the line has been quiet for a while.

        Servos that answer at the same time spoil each other's replies.

        Returns:
            The ids that were understood, and whether there was anything else on the line.

        Raises PortDisconnected.
        """
        message = request(BROADCAST_ID, PING)
        self.counters.requests += 1
        self.port.send(message)
        received = b""
        while chunk := self.port.receive(_LISTEN_BYTES, time.monotonic() + quiet_s):
            received += chunk
        received = received[len(message) * self._echo :]
        ids = [reply.servo_id for reply in Search().feed(received)]
        return sorted(set(ids)), len(received) != OVERHEAD * len(ids)

    def is_garbled(self, servo_id: int, address: int, length: int) -> bool:
        """Whether a read, in one attempt, brings only broken packets. Raises PortDisconnected."""
        corrupt = self.counters.corrupt
        found = self._ask(servo_id, READ, bytes((address, length)), length)
        return found is None and self.counters.corrupt > corrupt

    def detect_echo(self) -> None:
        """Learns whether the adapter returns what is sent, by an instruction that nobody answers.

        Raises PortDisconnected.
        """
        self._echo = 0
        message = request(BROADCAST_ID, SYNC_WRITE, bytes((0, 0)))  # a write of nothing, to nobody
        deadline_s = self._send(message, len(message))
        self._echo = int(self.port.receive(len(message), deadline_s) == message)

    def _ask(self, servo_id: int, instruction: int, parameters: bytes, length: int) -> Reply | None:
        """One request to one servo, one attempt."""
        message = request(servo_id, instruction, parameters)
        deadline_s = self._send(message, length + OVERHEAD)
        search = Search()
        found: Reply | None = None
        received = self._receive(message, length + OVERHEAD, deadline_s)
        for reply in self._replies(received, deadline_s, search):
            if reply.servo_id == servo_id and len(reply.data) == length:
                found = reply
                break
            self.counters.stale += 1
        self.counters.corrupt += search.broken
        if found is None:
            self._lose(servo_id)
        else:
            self.status[servo_id] = found.error
        return found

    def _sync_read_once(self, address: int, length: int, ids: tuple[int, ...]) -> dict[int, bytes]:
        size = length + self._next_padding()
        key = (address, size, ids)
        message = self._requests.get(key)
        if message is None:
            message = request(BROADCAST_ID, SYNC_READ, bytes((address, size, *ids)))
            self._requests[key] = message
        total = (size + OVERHEAD) * len(ids)
        deadline_s = self._send(message, total)
        received = self._receive(message, total, deadline_s)
        values = self._take_all(received, size, length, ids)
        if values is not None:
            return values
        return self._sort_out(received, size, length, ids, deadline_s)

    def _take_all(
        self, received: bytes, size: int, length: int, ids: Sequence[int]
    ) -> dict[int, bytes] | None:
        """The usual case: every reply whole and in its place; None where anything is amiss."""
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
            values[servo_id] = body[3 : 3 + length]
            at = end
        return values

    def _sort_out(
        self, received: bytes, size: int, length: int, ids: Sequence[int], deadline_s: float
    ) -> dict[int, bytes]:
        """The unusual case: takes whole replies of the right length, provided that they are in order."""
        place = {servo_id: index for index, servo_id in enumerate(ids)}
        taken: dict[int, bytes] = {}
        last = -1
        search = Search()
        for reply in self._replies(received, deadline_s, search):
            index = place.get(reply.servo_id)
            if index is None or len(reply.data) != size:
                self.counters.stale += 1
                continue
            if index <= last:  # a late reply is among them, and nothing tells which one it is
                self.counters.stale += 1
                self._expect_late_replies()
                return {}
            last = index
            self.status[reply.servo_id] = reply.error
            taken[reply.servo_id] = reply.data[:length]
            if len(taken) == len(ids):
                break
        for servo_id in ids:
            if servo_id not in taken:
                self._lose(servo_id)
        self.counters.corrupt += search.broken
        return taken

    def _send(self, message: bytes, reply_size: int) -> float:
        """Sends a request; returns until when its replies are waited for."""
        self.counters.requests += 1
        self.port.send(message)
        wire_s = self.port.wire_time_s(len(message) * (1 + self._echo) + reply_size)
        return time.monotonic() + wire_s + self.reply_margin_s

    def _receive(self, message: bytes, size: int, deadline_s: float) -> bytes:
        echoed = len(message) * self._echo
        return self.port.receive(size + echoed, deadline_s)[echoed:]

    def _replies(self, received: bytes, deadline_s: float, search: Search) -> Iterator[Reply]:
        """Replies in what was received, then in what still comes until the deadline."""
        yield from search.feed(received)
        while time.monotonic() < deadline_s:
            yield from search.feed(self.port.receive(1, deadline_s))

    def _next_padding(self) -> int:
        """Further bytes to ask for, so that a late reply to an earlier request has another length."""
        if not self._uncertain_until_s:
            return 0
        if time.monotonic() > self._uncertain_until_s:
            self._uncertain_until_s = 0.0
            self._padding = 0
            return 0
        self._padding = self._padding % PADDINGS + 1
        return self._padding

    def _lose(self, servo_id: int) -> None:
        self.counters.lose(servo_id)
        self._expect_late_replies()

    def _expect_late_replies(self) -> None:
        self._uncertain_until_s = time.monotonic() + LATE_HORIZON_S

    def _no_reply(self, servo_id: int, what: str) -> NoReply:
        return NoReply(
            f"{self.port}: id {servo_id} does not answer {what} in {self.retries + 1} attempts. "
            "Check its cable and the supply; joshua doctor looks at the whole chain."
        )
