"""A half-duplex bus of servos: recipients, timing of replies, and line faults."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.servo_bus.servo import EmulatedServo
from joshua_emulator.wire import TimedReply, WireClock

SPEED_TOLERANCE = 0.03  # a UART tolerates this relative error of the line speed

ServoT = TypeVar("ServoT", bound=EmulatedServo)


class Packet(Protocol):
    """An instruction; ``size`` counts the bytes on the line that led up to its end, noise included."""

    @property
    def servo_id(self) -> int:
        """Id of the recipient."""

    @property
    def instruction(self) -> int:
        """Number of the instruction."""

    @property
    def parameters(self) -> bytes:
        """Parameters."""

    @property
    def size(self) -> int:
        """Number of bytes on the line."""


class Parser(Protocol):
    """Finds instructions in received bytes."""

    def feed(self, data: bytes) -> Iterator[Packet]:
        """Add bytes and yield each complete packet."""

    def clear(self) -> None:
        """Discard a partial packet."""


class EmulatedServoBus(ABC, Generic[ServoT]):
    """Servos on one cable, nearest to the adapter first; subclasses implement the protocol."""

    #: Finds the packets of the protocol in what the host sends.
    make_parser: ClassVar[type[Parser]]
    #: Instructions by their number, for the log, and those that read only.
    names: ClassVar[Mapping[int, str]]
    reads: ClassVar[Collection[int]]

    def __init__(
        self, servos: Sequence[ServoT], log: EventLog, faults: Faults, *, echo: bool = False
    ) -> None:
        self.servos = list(servos)
        self.connected = len(self.servos)  # servos before the break of the cable
        self.parser = self.make_parser()
        self._log = log
        self._faults = faults
        self._echo = echo
        self._wire = WireClock()
        self._sequence = itertools.count()

    def attach(self, servo: ServoT) -> None:
        """Add a servo at the far end of the cable."""
        intact = self.connected == len(self.servos)
        self.servos.append(servo)
        if intact:
            self.connected += 1

    @abstractmethod
    def _answer(
        self, packet: Any, listening: list[ServoT], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        """Execute an instruction that ``listening`` receive at ``end_s``; return their replies."""

    def reset_line(self) -> None:
        """Discard a partial packet, as for a new connection."""
        self.parser.clear()

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Process bytes sent at ``line_speed`` bit/s. Return the replies and their times."""
        listening = [
            servo for servo in self.servos[: self.connected] if self._hears(servo, line_speed, now_s)
        ]
        replies = [self._timed(data, now_s)] if self._echo else []
        if not listening:
            self.reset_line()
            return replies
        for packet in self.parser.feed(data):
            end_s = self._wire.request(packet.size, line_speed, now_s)
            self._record(packet, now_s, end_s)
            if not self._faults.loses_request():
                replies += self._answer(packet, listening, line_speed, end_s)
        return replies

    def _hears(self, servo: ServoT, line_speed: int, now_s: float) -> bool:
        return (
            abs(servo.baudrate - line_speed) <= SPEED_TOLERANCE * servo.baudrate
            and now_s >= servo.silent_until_s
            and not servo.silent
        )

    def _transmit(self, answers: list[tuple[ServoT, bytes]], line_speed: int) -> Iterable[TimedReply]:
        """Put replies on the line; several at once collide: a 0 bit wins over a 1."""
        if not answers:
            return
        size = max(len(data) for _, data in answers)
        merged = bytearray(b"\xff" * size)
        for _, data in answers:
            for index, byte in enumerate(data):
                merged[index] &= byte
        delay_s = min(servo.return_delay_s for servo, _ in answers)
        due_s = self._wire.reply(size, line_speed, delay_s)
        disturbed = self._faults.disturb(bytes(merged))
        if disturbed is not None:
            data, late_s = disturbed
            yield self._timed(data, due_s + late_s)

    def _timed(self, data: bytes, due_s: float) -> TimedReply:
        return TimedReply(due_s, next(self._sequence), data)

    def _record(self, packet: Packet, now_s: float, end_s: float) -> None:
        """Log an instruction; reads are only counted."""
        if packet.instruction in self.reads:
            self._log.reads += 1
            return
        self._log.add(
            self.names.get(packet.instruction, f"0x{packet.instruction:02x}"),
            now_s,
            wire_end_ns=round(end_s * 1e9),
            id=packet.servo_id,
            parameters=packet.parameters.hex(),
        )
