"""A servo bus: requests out, replies in, matched by id, length, order and checksum. This is the hot path.

A reply carries no number of its request, so a late one could pass for an answer to the next. Three rules keep
it out: received bytes are dropped before each request; the replies of a sync read must come in the order of
the request, each once, or none of them is believed; and after a lost reply requests ask for a varying number
of further bytes for a while, so that a late reply has the wrong length.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import ClassVar

from joshua_serial.port import SerialPort

from joshua_servo.bus_tools import FoundMotor
from joshua_servo.counters import BusCounters
from joshua_servo.errors import NoReply, ServoRefused
from joshua_servo.register import Register
from joshua_servo.reply import Reply, ReplySearch

REPLY_MARGIN_S = 0.02  # beyond wire time: adapters hold bytes back for up to 16 ms
RETRIES = 4  # with the margin a tenth of a second: a busy host may stand still for that long
LATE_HORIZON_S = 0.25  # how long after a lost reply a late one is reckoned with
PADDINGS = 15
BROADCAST_ID = 0xFE  # of the protocols of all families
_LISTEN_BYTES = 255


class ServoBus(ABC):
    """Requests to the servos on one port; the packets are those of one protocol.

    Args:
        reply_margin_s: how long after its wire time a reply may come.
        retries: how often a request is repeated for servos that did not answer.
    """

    #: Bytes of a reply beside its data.
    reply_overhead: ClassVar[int]
    #: Line speeds that the servos know, bit/s.
    baudrates: ClassVar[Collection[int]]

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

    @abstractmethod
    def identify(self, servo_id: int) -> FoundMotor:
        """Reads model, firmware and, once, the state of one servo.

        The state differs between two servos of one id, so that their replies collide.
        Raises NoReply and PortDisconnected.
        """

    @abstractmethod
    def read_request(self, servo_id: int, address: int, length: int) -> bytes:
        """Packet that reads bytes of one servo."""

    @abstractmethod
    def write_request(self, servo_id: int, address: int, data: bytes) -> bytes:
        """Packet that writes bytes of one servo."""

    @abstractmethod
    def ping_request(self, servo_id: int) -> bytes:
        """Packet that asks whether a servo is there."""

    @abstractmethod
    def sync_read_request(self, address: int, length: int, ids: Sequence[int]) -> bytes:
        """Packet that reads the same bytes of several servos."""

    @abstractmethod
    def sync_write_request(self, address: int, width: int, rows: Mapping[int, bytes]) -> bytes:
        """Packet that writes the same bytes of several servos; nobody answers it."""

    @abstractmethod
    def take_all(self, received: bytes, size: int, ids: Sequence[int]) -> dict[int, bytes] | None:
        """The usual case of a sync read: every reply whole and in its place; None where anything is amiss.

        Args:
            size: data bytes of each reply.
        """

    @abstractmethod
    def make_search(self) -> ReplySearch:
        """A search for replies in received bytes."""

    def ping_length(self) -> int:
        """Data bytes in the reply to a ping."""
        return 0

    def refusal(self, error: int) -> str:
        """Why a servo refuses a request, by the error of its reply; "" where it does not."""
        del error
        return ""

    def padded(self, address: int, length: int, padding: int) -> tuple[int, int, int]:
        """Start and size of a read with further bytes, and how many of these lie in front."""
        return address, length + padding, 0

    def sync_read(
        self,
        address: int,
        length: int,
        ids: tuple[int, ...],
        *,
        retries: int | None = None,
        within_s: float = math.inf,
    ) -> dict[int, bytes]:
        """Reads the same bytes of several servos; those that do not answer within all retries are left out.

        Args:
            within_s: no retry begins later than this; on a busy machine each takes longer than its time-out.

        Raises PortDisconnected.
        """
        began_s = time.monotonic()
        values = self._sync_read_once(address, length, ids)
        for _ in range(self.retries if retries is None else retries):
            if len(values) == len(ids) or time.monotonic() - began_s > within_s:
                break
            self.counters.retries += 1
            missing = tuple(servo_id for servo_id in ids if servo_id not in values)
            values |= self._sync_read_once(address, length, missing)
        return values

    def sync_write(self, address: int, width: int, rows: Mapping[int, bytes]) -> None:
        """Writes ``width`` bytes to several servos at once; nobody answers. Raises PortDisconnected."""
        self.counters.requests += 1
        self.port.send(self.sync_write_request(address, width, rows))

    def read(self, servo_id: int, register: Register) -> int:
        """Reads one register. Raises NoReply, ServoRefused and PortDisconnected."""
        return register.decode(self.read_block(servo_id, register.address, register.width))

    def read_block(self, servo_id: int, address: int, length: int) -> bytes:
        """Reads bytes of one servo. Raises NoReply, ServoRefused and PortDisconnected."""
        for attempt in range(self.retries + 1):
            self.counters.retries += attempt > 0
            start, size, skip = self.padded(address, length, self._next_padding())
            reply = self.ask(servo_id, self.read_request(servo_id, start, size), size)
            if reply is not None:
                self._check(reply, f"a read of {length} bytes at {address}")
                return reply.data[skip : skip + length]
        raise self._no_reply(servo_id, "a read")

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Writes one register and waits for the acknowledgement.

        Raises NoReply, ServoRefused and PortDisconnected.
        """
        message = self.write_request(servo_id, register.address, register.encode(value))
        for attempt in range(self.retries + 1):
            self.counters.retries += attempt > 0
            reply = self.ask(servo_id, message, 0)
            if reply is not None:
                self._check(reply, f"{register.name} = {value}")
                return
        raise self._no_reply(servo_id, f"a write of {register.name}")

    def write_checked(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Writes registers and reads each one back.

        Raises NoReply, also where a register did not keep its value, ServoRefused and PortDisconnected.
        """
        for register, value in values.items():
            self.write(servo_id, register, value)
            kept = self.read(servo_id, register)
            if kept != value:
                raise NoReply(
                    f"{self.port}: id {servo_id} keeps {register.name} at {kept} instead of {value}. "
                    "Check the supply voltage and try again; the servo may be worn out."
                )

    def write_eeprom(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Writes registers of the EEPROM and reads each one back. Raises as ``write_checked``."""
        self.write_checked(servo_id, values)

    def ping(self, servo_id: int) -> bool:
        """Whether a servo answers, in one attempt. Raises PortDisconnected."""
        return self.ask(servo_id, self.ping_request(servo_id), self.ping_length()) is not None

    def roll_call(self, ids: Iterable[int], margin_s: float) -> set[int]:
        """Pings these ids one after the other, each in one attempt; returns all that answered meanwhile.

        A reply names its servo, so one that comes while the next id is asked already counts as well: a busy
        host may keep it back for longer than a search through all ids can wait each time.

        Args:
            margin_s: how long after its wire time each reply is waited for.

        Raises PortDisconnected.
        """
        heard: set[int] = set()
        usual_s, self.reply_margin_s = self.reply_margin_s, margin_s
        try:
            for servo_id in ids:
                if servo_id not in heard:
                    heard |= self._call(servo_id)
        finally:
            self.reply_margin_s = usual_s
            self._expect_late_replies()
        return heard

    def _call(self, servo_id: int) -> set[int]:
        """Who answers to one ping, until the one that it is for does."""
        message, size = self.ping_request(servo_id), self.reply_overhead + self.ping_length()
        deadline_s = self._send(message, size)
        heard: set[int] = set()
        for reply in self._replies(self._receive(message, size, deadline_s), deadline_s, self.make_search()):
            if len(reply.data) == self.ping_length():
                heard.add(reply.servo_id)
            if servo_id in heard:
                break
        return heard

    def try_write(self, servo_id: int, register: Register, value: int) -> bool:
        """Writes one register, in one attempt; whether it was acknowledged. Raises PortDisconnected."""
        message = self.write_request(servo_id, register.address, register.encode(value))
        reply = self.ask(servo_id, message, 0)
        return reply is not None and not self.refusal(reply.error)

    def call_all(self, quiet_s: float) -> tuple[list[int], bool]:
        """Pings everybody at once, in one attempt; listens until the line has been quiet for a while.

        Servos that answer at the same time spoil each other's replies.

        Returns:
            The ids that were understood, and whether there was anything else on the line.

        Raises PortDisconnected.
        """
        message = self.ping_request(BROADCAST_ID)
        self.counters.requests += 1
        self.port.send(message)
        received = b""
        while chunk := self.port.receive(_LISTEN_BYTES, time.monotonic() + quiet_s):
            received += chunk
        received = received.partition(message)[2] if self._echo else received
        ids = [reply.servo_id for reply in self.make_search().feed(received)]
        understood = (self.reply_overhead + self.ping_length()) * len(ids)
        return sorted(set(ids)), len(received) != understood

    def is_garbled(self, servo_id: int, address: int, length: int) -> bool:
        """Whether a read, in one attempt, brings only broken packets. Raises PortDisconnected."""
        corrupt = self.counters.corrupt
        found = self.ask(servo_id, self.read_request(servo_id, address, length), length)
        return found is None and self.counters.corrupt > corrupt

    def detect_echo(self) -> None:
        """Learns whether the adapter returns what is sent, by an instruction that nobody answers.

        Raises PortDisconnected.
        """
        self._echo = 0
        message = self.sync_write_request(0, 0, {})  # a write of nothing, to nobody
        deadline_s = self._send(message, len(message))
        self._echo = int(self.port.receive(len(message), deadline_s) == message)

    def ask(self, servo_id: int, message: bytes, length: int) -> Reply | None:
        """One request to one servo, one attempt; None where no whole reply came. Raises PortDisconnected.

        Args:
            length: data bytes of the reply; a reply that says why a servo refuses has none.
        """
        size = length + self.reply_overhead
        deadline_s = self._send(message, size)
        search = self.make_search()
        found: Reply | None = None
        received = self._receive(message, size, deadline_s)
        for reply in self._replies(received, deadline_s, search):
            fits = len(reply.data) == length or (not reply.data and self.refusal(reply.error))
            if reply.servo_id == servo_id and fits:
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
        skip = 0
        size = length
        if self._uncertain_until_s:
            address, size, skip = self.padded(address, length, self._next_padding())
        key = (address, size, ids)
        message = self._requests.get(key)
        if message is None:
            message = self._requests[key] = self.sync_read_request(address, size, ids)
        total = (size + self.reply_overhead) * len(ids)
        deadline_s = self._send(message, total)
        received = self._receive(message, total, deadline_s)
        values = self.take_all(received, size, ids)
        if values is None:
            values = self._sort_out(received, size, ids, deadline_s)
        if size != length:
            return {servo_id: data[skip : skip + length] for servo_id, data in values.items()}
        return values

    def _sort_out(
        self, received: bytes, size: int, ids: Sequence[int], deadline_s: float
    ) -> dict[int, bytes]:
        """The unusual case: takes whole replies of the right length, provided that they are in order."""
        place = {servo_id: index for index, servo_id in enumerate(ids)}
        taken: dict[int, bytes] = {}
        last = -1
        search = self.make_search()
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
            taken[reply.servo_id] = reply.data
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
        if not self._echo:
            return self.port.receive(size, deadline_s)
        received = self.port.receive(size + len(message), deadline_s)
        while message not in received and time.monotonic() < deadline_s:  # an earlier one came late
            received += self.port.receive(len(message), deadline_s)
        return received.partition(message)[2]

    def _replies(self, received: bytes, deadline_s: float, search: ReplySearch) -> Iterator[Reply]:
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

    def _check(self, reply: Reply, what: str) -> None:
        reason = self.refusal(reply.error)
        if reason:
            raise ServoRefused(f"{self.port}: id {reply.servo_id} refuses {what}: {reason}")

    def _no_reply(self, servo_id: int, what: str) -> NoReply:
        return NoReply(
            f"{self.port}: id {servo_id} does not answer {what} in {self.retries + 1} attempts. "
            "Check its cable and the supply; joshua doctor looks at the whole chain."
        )
