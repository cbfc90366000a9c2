"""A half-duplex bus of servos: who hears, when replies are on the line, and what spoils them."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Generic, TypeVar

from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.servo_bus.servo import EmulatedServo
from joshua_emulator.wire import TimedReply, WireClock

SPEED_TOLERANCE = 0.03  # a UART still reads bytes whose speed is off by this share

ServoT = TypeVar("ServoT", bound=EmulatedServo)


class EmulatedServoBus(ABC, Generic[ServoT]):
    """Servos on one cable, nearest to the adapter first; a protocol says what bytes mean."""

    def __init__(
        self, servos: Sequence[ServoT], log: EventLog, faults: Faults, *, echo: bool = False
    ) -> None:
        self.servos = list(servos)
        self.connected = len(self.servos)  # servos before the place where the cable is broken
        self._log = log
        self._faults = faults
        self._echo = echo
        self._wire = WireClock()
        self._sequence = itertools.count()

    def attach(self, servo: ServoT) -> None:
        """Adds a servo at the far end of the cable."""
        intact = self.connected == len(self.servos)
        self.servos.append(servo)
        if intact:
            self.connected += 1

    @abstractmethod
    def reset_line(self) -> None:
        """Forgets an unfinished packet, as a fresh connection does."""

    @abstractmethod
    def hear(
        self, data: bytes, listening: list[ServoT], line_speed: int, now_s: float
    ) -> Iterable[TimedReply]:
        """Takes bytes that some servos hear; returns what these answer and when."""

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Takes bytes of the host, sent at ``line_speed`` bit/s; returns what the bus answers and when."""
        listening = [
            servo for servo in self.servos[: self.connected] if self._hears(servo, line_speed, now_s)
        ]
        replies = [self._timed(data, now_s)] if self._echo else []
        if not listening:
            self.reset_line()
            return replies
        replies += self.hear(data, listening, line_speed, now_s)
        return replies

    def _hears(self, servo: ServoT, line_speed: int, now_s: float) -> bool:
        return (
            abs(servo.baudrate - line_speed) <= SPEED_TOLERANCE * servo.baudrate
            and now_s >= servo.silent_until_s
            and not servo.silent
        )

    def _transmit(self, answers: list[tuple[ServoT, bytes]], line_speed: int) -> Iterable[TimedReply]:
        """Puts replies on the line; several at once collide: a 0 bit wins over a 1."""
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

    def _record(
        self, name: str, servo_id: int, parameters: bytes, now_s: float, end_s: float, *, read: bool
    ) -> None:
        """Logs an instruction; reads are only counted."""
        if read:
            self._log.reads += 1
            return
        self._log.add(name, now_s, wire_end_ns=round(end_s * 1e9), id=servo_id, parameters=parameters.hex())
