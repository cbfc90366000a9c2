"""A servo bus: requests out, replies in, matched by id, length, order and checksum. This is the hot path.

A reply does not identify its request, so a late one could be mistaken for the reply to another. Five rules
prevent that for ``LATE_HORIZON_S`` after the timeout:

- Received bytes are dropped before each request.
- The replies of a sync read must come in the order of the request, each once, or all are rejected.
- The possible length of a late reply is claimed. A read requests additional bytes to get a free length. Reads
  of a single servo do so after answered requests, too.
- If the length cannot vary, as in an acknowledgement, further requests to that servo wait.
- A write counts as successful if its register reads back the value.

Why one file: requests and the rules that match their replies are one hot path.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import ClassVar, NamedTuple

from joshua.api.patience import SILENCE_LIMIT_S, Patience
from joshua_serial.port import SerialPort

from joshua_servo.bus_tools import FoundMotor
from joshua_servo.counters import BusCounters
from joshua_servo.errors import NoReply, ServoRefused
from joshua_servo.register import Register
from joshua_servo.reply import Reply, ReplySearch

REPLY_MARGIN_S = 0.02  # beyond wire time: adapters hold bytes back for up to 16 ms
LONGEST_WAIT_S = SILENCE_LIMIT_S / 5  # for one reply, because a busy host delays replies
WRITES = 5  # of a register whose servo replies, but keeps another value
TELLING_DELAY_S = 0.05  # of this process, in a message
LATE_HORIZON_S = 0.25  # time after a lost reply in which it may still arrive late
COPY_S = 0.02  # time after a reply in which a copy of it may arrive
PADDINGS = 15  # lengths of one read beside its own
BROADCAST_ID = 0xFE  # of the protocols of all families
_LISTEN_BYTES = 255


class _Claim(NamedTuple):
    """A length of replies to a request, received or still possible."""

    until_s: float
    message: bytes
    is_lost: bool

    @property
    def blocks_until_s(self) -> float:
        """Time until which no other request may have this length."""
        return self.until_s if self.is_lost else self.until_s - LATE_HORIZON_S + COPY_S


class ServoBus(ABC):
    """Requests to the servos on one port, in the packets of one protocol.

    Args:
        reply_margin_s: longest delay of the first reply after its wire time. The next ones may take longer.
        patience_s: awake time after which a servo without a reply counts as silent, see ``Patience``.
    """

    #: Whether a servo may refuse any request with a reply without data.
    refuses: ClassVar[bool] = False
    #: Bytes of a reply without its data.
    reply_overhead: ClassVar[int]
    #: Line speeds of the servos, bit/s.
    baudrates: ClassVar[Collection[int]]

    def __init__(
        self,
        port: SerialPort,
        *,
        reply_margin_s: float = REPLY_MARGIN_S,
        patience_s: float = SILENCE_LIMIT_S,
    ) -> None:
        self.port = port
        self.reply_margin_s = reply_margin_s
        self.patience_s = patience_s
        self._spent: Patience | None = None  # of the last sync read, if servos are missing in it
        self._late = 0  # readings with missing replies in a row
        self.counters = BusCounters()
        self.status: dict[int, int] = {}  # error byte of each servo's last reply
        self._echo = 0  # 1 if the adapter echoes sent bytes
        self._last: tuple[tuple[int, ...], int, bytes] | None = None  # ids, length, message of a sync read
        self._claims: dict[tuple[int, int], _Claim] = {}  # by servo id and data bytes of the reply
        self._requests: dict[tuple[int, int, tuple[int, ...]], bytes] = {}

    @abstractmethod
    def identify(self, servo_id: int) -> FoundMotor:
        """Read model, firmware and, once, the state of one servo.

        The state differs between two servos with the same id, so their replies collide. Raises NoReply and
        PortDisconnected.
        """

    @abstractmethod
    def read_request(self, servo_id: int, address: int, length: int) -> bytes:
        """Packet that reads bytes of one servo."""

    @abstractmethod
    def write_request(self, servo_id: int, address: int, data: bytes) -> bytes:
        """Packet that writes bytes of one servo."""

    @abstractmethod
    def ping_request(self, servo_id: int) -> bytes:
        """Packet that pings a servo."""

    @abstractmethod
    def sync_read_request(self, address: int, length: int, ids: Sequence[int]) -> bytes:
        """Packet that reads the same bytes of several servos."""

    @abstractmethod
    def sync_write_request(self, address: int, width: int, rows: Mapping[int, bytes]) -> bytes:
        """Packet that writes the same bytes of several servos, without a reply."""

    @abstractmethod
    def take_all(self, received: bytes, size: int, ids: Sequence[int]) -> dict[int, bytes] | None:
        """The usual case of a sync read: every reply is complete and in place; None otherwise.

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
        """Why a servo refuses a request, by the error of its reply; "" if it does not."""
        del error
        return ""

    def padded(self, address: int, length: int, padding: int) -> tuple[int, int, int]:
        """Start and size of a read with additional bytes, and the number of those before the data."""
        return address, length + padding, 0

    def sync_read(
        self,
        address: int,
        length: int,
        ids: tuple[int, ...],
        *,
        within_s: float | None = None,
    ) -> dict[int, bytes]:
        """Read the same bytes of several servos, without those that do not reply.

        Args:
            within_s: for a caller that is called again: no retry begins later than this. None repeats the
                request until the patience with the servos ends; ``no_reply`` then explains the missing ones.

        Raises PortDisconnected.
        """
        if within_s is not None:
            return self._sync_read_within(address, length, ids, within_s)
        patience = self._patience()
        values: dict[int, bytes] = {}
        while True:
            missing = tuple(servo_id for servo_id in ids if servo_id not in values)
            patience.begin()
            wait_s = self.wait_s(patience.misses, patience.left_s)
            values |= self._sync_read_once(address, length, missing, wait_s)
            if len(values) == len(ids):
                self._spent = None
                return values
            if not patience.miss():
                self._spent = patience
                return values
            self.counters.retries += 1

    def _sync_read_within(
        self, address: int, length: int, ids: tuple[int, ...], within_s: float
    ) -> dict[int, bytes]:
        """One attempt, and retries that begin in time. While servos are silent, each waits longer."""
        until_s = time.monotonic() + within_s
        self._spent = None
        wait_s = self.wait_s(self._late, within_s)
        values = self._sync_read_once(address, length, ids, wait_s, until_s)
        while len(values) < len(ids):
            self._late += 1
            left_s = until_s - time.monotonic()
            if left_s < self.reply_margin_s / 2:  # a shorter wait would find nothing
                return values
            self.counters.retries += 1
            missing = tuple(servo_id for servo_id in ids if servo_id not in values)
            wait_s = self.wait_s(self._late, left_s)
            values |= self._sync_read_once(address, length, missing, wait_s, until_s)
        self._late = 0
        return values

    def no_reply(self, claim: str, remedy: str) -> NoReply:
        """An error for servos that are missing in the last sync read.

        The servos are blamed only if they left requests unanswered for long enough.

        Args:
            claim: such as ``no servo answers``; remedy: sentences.
        """
        if self._spent is None:  # one cycle of a loop, which judges itself
            return NoReply(f"{self.port}: {claim}. {remedy}")
        return self.explain(claim, remedy, self._spent)

    def explain(self, claim: str, remedy: str, patience: Patience, *, garbled: bool = False) -> NoReply:
        """An error for servos with which the patience has ended. Arguments as of ``no_reply``."""
        delayed_s = patience.delayed_s
        if patience.is_silent:
            delay = f", besides {delayed_s:.2f} s of delays of this process" * (delayed_s > TELLING_DELAY_S)
            asked = f"no reply to {patience.misses} requests in {patience.awake_s:.2f} s{delay}"
            return NoReply(f"{self.port}: {claim}: {asked}. {remedy}", garbled=garbled)
        return NoReply(
            f"{self.port}: no reply for {patience.gap_s:.1f} s, of which this process was delayed by "
            f"{delayed_s:.1f} s: the machine is too busy to tell whether a servo is at fault. Close other "
            "programs, then try again. `joshua doctor` says how to give drivers priority.",
            is_proof=False,
        )

    def _patience(self) -> Patience:
        """The patience with servos that do not reply to one request."""
        period_s = max(LONGEST_WAIT_S, self.reply_margin_s)
        return Patience(self.patience_s, period_s=period_s)

    def wait_s(self, misses: int, left_s: float) -> float:
        """Return the delay of a reply to wait for: longer after each miss."""
        longer_s = min(self.reply_margin_s * (1 << min(misses, 8)), LONGEST_WAIT_S, left_s)
        return max(self.reply_margin_s, longer_s)

    def sync_write(self, address: int, width: int, rows: Mapping[int, bytes]) -> None:
        """Write ``width`` bytes to several servos in one packet, without replies. Raises PortDisconnected."""
        self.counters.requests += 1
        self.port.send(self.sync_write_request(address, width, rows))

    def read(self, servo_id: int, register: Register) -> int:
        """Read one register. Raises NoReply, ServoRefused and PortDisconnected."""
        return register.decode(self.read_block(servo_id, register.address, register.width))

    def read_block(self, servo_id: int, address: int, length: int) -> bytes:
        """Read bytes of one servo. Raises NoReply, ServoRefused and PortDisconnected."""
        patience, garbled = self._patience(), 0
        while True:
            found = self._wait_for_length(address, length, (servo_id,))
            assert found is not None
            start, size, skip = found
            corrupt = self.counters.corrupt
            patience.begin()
            wait_s = self.wait_s(patience.misses, patience.left_s)
            reply = self.ask(servo_id, self.read_request(servo_id, start, size), size, wait_s)
            if reply is not None:
                self._check(reply, f"a read of {length} bytes at {address}")
                return reply.data[skip : skip + length]
            garbled += self.counters.corrupt > corrupt
            if not patience.miss():
                raise self._not_answered(servo_id, "a read", patience, garbled=2 * garbled > patience.misses)
            self.counters.retries += 1

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Write one register and read it back.

        Raises NoReply, also if the register does not keep the value, ServoRefused and PortDisconnected.
        """
        message = self.write_request(servo_id, register.address, register.encode(value))
        for _ in range(WRITES):
            self._acknowledged(servo_id, message, f"{register.name} = {value}", f"a write of {register.name}")
            kept = self.read(servo_id, register)
            if kept == value:
                return
            self.counters.retries += 1
        raise NoReply(
            f"{self.port}: id {servo_id} keeps {register.name} at {kept} instead of {value}. "
            "Check the supply voltage and try again. The servo may be worn out."
        )

    def _acknowledged(self, servo_id: int, message: bytes, change: str, what: str) -> None:
        """Send a write until it is acknowledged. Raises NoReply, ServoRefused and PortDisconnected."""
        patience = self._patience()
        while True:
            patience.begin()
            reply = self.ask(servo_id, message, 0, self.wait_s(patience.misses, patience.left_s))
            if reply is not None:
                self._check(reply, change)
                return
            if not patience.miss():
                raise self._not_answered(servo_id, what, patience)
            self.counters.retries += 1

    def write_checked(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Write registers and read each one back. Raises as ``write``."""
        for register, value in values.items():
            self.write(servo_id, register, value)

    def write_eeprom(self, servo_id: int, values: Mapping[Register, int]) -> None:
        """Write registers of the EEPROM and read each one back. Raises as ``write_checked``."""
        self.write_checked(servo_id, values)

    def ping(self, servo_id: int) -> bool:
        """Whether a servo replies, in one attempt. Raises PortDisconnected."""
        return self.ask(servo_id, self.ping_request(servo_id), self.ping_length()) is not None

    def roll_call(self, ids: Iterable[int], margin_s: float) -> set[int]:
        """Ping ids one after the other, each in one attempt. Returns all that replied meanwhile.

        A reply names its servo, so a late one that arrives during the ping of the next id also counts. A busy
        host may delay it for longer than a search can wait for each id.

        Args:
            margin_s: waiting time for each reply after its wire time.

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
        return heard

    def _call(self, servo_id: int) -> set[int]:
        """Ids that reply after one ping, until the pinged one does."""
        message, size = self.ping_request(servo_id), self.reply_overhead + self.ping_length()
        deadline_s = self._send(message, size)
        heard: set[int] = set()
        for reply in self._replies(self._receive(message, size, deadline_s), deadline_s, self.make_search()):
            if len(reply.data) == self.ping_length():
                heard.add(reply.servo_id)
            if servo_id in heard:
                return heard
        self._claim(servo_id, self.ping_length(), message, is_lost=True)
        return heard

    def try_write(self, servo_id: int, register: Register, value: int) -> bool:
        """Write one register, in one attempt; whether it was acknowledged. Raises PortDisconnected."""
        message = self.write_request(servo_id, register.address, register.encode(value))
        reply = self.ask(servo_id, message, 0)
        return reply is not None and not self.refusal(reply.error)

    def call_all(self, quiet_s: float) -> tuple[list[int], bool]:
        """Ping all servos with one broadcast, and receive until the line is quiet for a while.

        Simultaneous replies corrupt each other.

        Returns:
            The ids of valid replies, and whether anything else was received.

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
        """Whether a read, in one attempt, returns only broken packets. Raises PortDisconnected."""
        corrupt = self.counters.corrupt
        found = self.ask(servo_id, self.read_request(servo_id, address, length), length)
        return found is None and self.counters.corrupt > corrupt

    @property
    def echoes(self) -> bool:
        """Whether the adapter echoes sent bytes, as detected or set."""
        return bool(self._echo)

    @echoes.setter
    def echoes(self, echoes: bool) -> None:
        self._echo = int(echoes)

    def detect_echo(self) -> None:
        """Detect whether the adapter echoes sent bytes, with an instruction that no servo answers.

        Raises PortDisconnected.
        """
        self._echo = 0
        message = self.sync_write_request(0, 0, {})  # an empty write to an unused id
        deadline_s = self._send(message, len(message))
        received = self.port.receive(len(message), deadline_s)
        while received and message not in received and time.monotonic() < deadline_s:  # after a late reply
            received += self.port.receive(1, deadline_s)
        self._echo = int(message in received)

    def ask(self, servo_id: int, message: bytes, length: int, wait_s: float | None = None) -> Reply | None:
        """One request to one servo, one attempt; None if no whole reply came. Raises PortDisconnected.

        Args:
            length: data bytes of the reply. A refusal has none.
            wait_s: delay of the reply to wait for, by default ``reply_margin_s``.
        """
        self._wait_for_claim(servo_id, length, message)
        is_second = self._is_lost(servo_id, length)  # the reply to the first may arrive, too
        size = length + self.reply_overhead
        refusable = not self._is_claimed(servo_id, 0, message)
        deadline_s = self._send(message, size, wait_s)
        search = self.make_search()
        found: Reply | None = None
        received = self._receive(message, size, deadline_s)
        for reply in self._replies(received, deadline_s, search):
            fits = len(reply.data) == length or (refusable and not reply.data and self.refusal(reply.error))
            if reply.servo_id == servo_id and fits:
                found = reply
                break
            self.counters.stale += 1
        self.counters.corrupt += search.broken
        if found is None:
            self._lose(servo_id, length, message)
        else:
            self._claim(servo_id, length, message, is_lost=is_second or bool(self.refusal(found.error)))
            self.status[servo_id] = found.error
        return found

    def _sync_read_once(
        self, address: int, length: int, ids: tuple[int, ...], wait_s: float, until_s: float = math.inf
    ) -> dict[int, bytes]:
        """One attempt; none if no length becomes free in time."""
        skip = 0
        size = length
        if self._claims or len(ids) == 1 or (self._last and self._last[0] != ids):
            found = self._wait_for_length(address, length, ids, until_s)
            if found is None:
                return {}
            address, size, skip = found
        is_fresh = size != length  # otherwise a copy of an earlier reply may have this length, too
        key = (address, size, ids)
        message = self._requests.get(key)
        if message is None:
            message = self._requests[key] = self.sync_read_request(address, size, ids)
        total = (size + self.reply_overhead) * len(ids)
        deadline_s = self._send(message, total, wait_s)
        received = self._receive(message, total, deadline_s)
        values = self.take_all(received, size, ids)
        if values is None:
            values = self._sort_out(received, size, ids, deadline_s)
            missing = [servo_id for servo_id in ids if not values or servo_id not in values]
            if values is None or (values and missing and not is_fresh):
                for servo_id in missing:
                    self._claim(servo_id, size, message, is_lost=True)
                # an order with gaps proves nothing if copies of earlier replies have this length
                if values is None:
                    return {}
                return self._sync_read_once(address, length, ids, wait_s, until_s)
            for servo_id in missing:
                self._lose(servo_id, size, message)
        if is_fresh or len(ids) == 1:
            for servo_id in values:
                self._claim(servo_id, size, message, is_lost=False)
        elif values:
            self._last = ids, size, message
        if size != length:
            return {servo_id: data[skip : skip + length] for servo_id, data in values.items()}
        return values

    def _sort_out(
        self, received: bytes, size: int, ids: Sequence[int], deadline_s: float
    ) -> dict[int, bytes] | None:
        """The unusual case: accept complete replies of the right length; None if they are out of order."""
        place = {servo_id: index for index, servo_id in enumerate(ids)}
        taken: dict[int, bytes] = {}
        last = -1
        search = self.make_search()
        for reply in self._replies(received, deadline_s, search):
            index = place.get(reply.servo_id)
            if index is None or len(reply.data) != size:
                self.counters.stale += 1
                continue
            if index <= last:  # one of them is a late reply, but it is unknown which
                self.counters.stale += 1
                return None
            last = index
            self.status[reply.servo_id] = reply.error
            taken[reply.servo_id] = reply.data
            if len(taken) == len(ids):
                break
        self.counters.corrupt += search.broken
        return taken

    def _send(self, message: bytes, reply_size: int, wait_s: float | None = None) -> float:
        """Send a request. Return the deadline of its replies."""
        self.counters.requests += 1
        self.port.send(message)
        wire_s = self.port.wire_time_s(len(message) * (1 + self._echo) + reply_size)
        return time.monotonic() + wire_s + (self.reply_margin_s if wait_s is None else wait_s)

    def _receive(self, message: bytes, size: int, deadline_s: float) -> bytes:
        if not self._echo:
            return self.port.receive(size, deadline_s)
        received = self.port.receive(size + len(message), deadline_s)
        while message not in received and time.monotonic() < deadline_s:  # an earlier one arrived late
            received += self.port.receive(len(message), deadline_s)
        return received.partition(message)[2]

    def _replies(self, received: bytes, deadline_s: float, search: ReplySearch) -> Iterator[Reply]:
        """Replies in the received bytes, then in those that arrive until the deadline."""
        yield from search.feed(received)
        while time.monotonic() < deadline_s:
            yield from search.feed(self.port.receive(1, deadline_s))

    def _free_length(self, address: int, length: int, ids: Sequence[int]) -> tuple[int, int, int] | None:
        """Start, size and skipped bytes of a read with a length that no late reply of these servos can have.

        If every length was used, the one answered longest ago; None if all may still arrive.
        """
        if (
            self._last is not None
        ):  # a copy of its last reply may arrive; an equal read would find it out of order
            (servo_ids, size, message), self._last = self._last, None
            for servo_id in servo_ids:
                self._claim(servo_id, size, message, is_lost=False)
        now_s = time.monotonic()
        self._claims = {key: claim for key, claim in self._claims.items() if claim.until_s > now_s}
        best: tuple[float, tuple[int, int, int]] | None = None
        for padding in range(PADDINGS + 1):
            read = self.padded(address, length, padding)
            claims = [claim for servo_id in ids if (claim := self._claims.get((servo_id, read[1])))]
            if not claims:
                return read
            latest_s = max(claim.until_s for claim in claims)
            is_blocked = any(claim.blocks_until_s > now_s for claim in claims)
            if not is_blocked and (best is None or latest_s < best[0]):
                best = latest_s, read
        return best[1] if best else None

    def _wait_for_length(
        self, address: int, length: int, ids: Sequence[int], until_s: float = math.inf
    ) -> tuple[int, int, int] | None:
        """As ``_free_length``, after waiting if necessary; None if no length is free at that time."""
        while (found := self._free_length(address, length, ids)) is None:
            now_s = time.monotonic()
            if now_s >= until_s:
                return None
            claims = [claim.blocks_until_s for key, claim in self._claims.items() if key[0] in ids]
            free_s = min((at_s for at_s in claims if at_s > now_s), default=now_s)
            _sleep_until(min(free_s, until_s))
        return found

    def _is_claimed(self, servo_id: int, length: int, message: bytes) -> bool:
        """Whether a late reply of this length to another request may still arrive."""
        return self._is_lost(servo_id, length) and self._claims[servo_id, length].message != message

    def _is_lost(self, servo_id: int, length: int) -> bool:
        """Whether a late reply of this length may still arrive."""
        claim = self._claims.get((servo_id, length))
        return claim is not None and claim.is_lost and claim.until_s > time.monotonic()

    def _wait_for_claim(self, servo_id: int, length: int, message: bytes) -> None:
        """Wait while a late reply of this length to another request may still arrive."""
        while self._is_claimed(servo_id, length, message):
            _sleep_until(self._claims[servo_id, length].until_s)

    def _lose(self, servo_id: int, length: int, message: bytes) -> None:
        """Count a missing reply and expect it late, also as a refusal."""
        self.counters.lose(servo_id)
        self._claim(servo_id, length, message, is_lost=True)
        if self.refuses:
            self._claim(servo_id, 0, message, is_lost=True)

    def _claim(self, servo_id: int, length: int, message: bytes, *, is_lost: bool) -> None:
        self._claims[servo_id, length] = _Claim(time.monotonic() + LATE_HORIZON_S, message, is_lost)

    def _check(self, reply: Reply, what: str) -> None:
        reason = self.refusal(reply.error)
        if reason:
            raise ServoRefused(f"{self.port}: id {reply.servo_id} refuses {what}: {reason}")

    def _not_answered(
        self, servo_id: int, what: str, patience: Patience, *, garbled: bool = False
    ) -> NoReply:
        remedy = "Check its cable and the supply; run joshua doctor to check the whole chain."
        return self.explain(f"id {servo_id} does not answer {what}", remedy, patience, garbled=garbled)


def _sleep_until(until_s: float) -> None:
    """Sleep slightly beyond a time, because of rounding."""
    time.sleep(max(0.0, until_s - time.monotonic()) + 1e-4)
