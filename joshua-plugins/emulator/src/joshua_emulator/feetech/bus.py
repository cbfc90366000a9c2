"""A bus of servos: hears instructions, answers with timed replies."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.feetech.packets import (
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    InstructionParser,
    status_packet,
)
from joshua_emulator.feetech.servo import MIDDLE, Servo
from joshua_emulator.wire import TimedReply, WireClock

LARGEST_READ = 250  # bytes of a reply; the length byte of a packet holds no more
SPEED_TOLERANCE = 0.03  # a UART still reads bytes whose speed is off by this share

_NAMES = {instruction.value: instruction.name.lower() for instruction in Instruction}


class FeetechBus:
    """Servos on one cable, nearest to the adapter first."""

    def __init__(self, servos: Sequence[Servo], log: EventLog, faults: Faults, *, echo: bool = False) -> None:
        self.servos = list(servos)
        self.connected = len(self.servos)  # servos before the place where the cable is broken
        self._log = log
        self._faults = faults
        self._echo = echo
        self._parser = InstructionParser()
        self._wire = WireClock()
        self._sequence = itertools.count()

    def attach(self, servo: Servo) -> None:
        """Adds a servo at the far end of the cable."""
        intact = self.connected == len(self.servos)
        self.servos.append(servo)
        if intact:
            self.connected += 1

    def reset_line(self) -> None:
        """Forgets an unfinished packet, as a fresh connection does."""
        self._parser.clear()

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Takes bytes of the host, sent at ``line_speed`` bit/s; returns what the bus answers and when."""
        listening = [
            servo for servo in self.servos[: self.connected] if self._hears(servo, line_speed, now_s)
        ]
        replies = [self._timed(data, now_s)] if self._echo else []
        if not listening:
            self._parser.clear()
            return replies
        for packet in self._parser.feed(data):
            end_s = self._wire.request(packet.size, line_speed, now_s)
            self._record(packet, now_s, end_s)
            if self._faults.loses_request():
                continue
            replies += self._answer(packet, listening, line_speed, end_s)
        return replies

    def _hears(self, servo: Servo, line_speed: int, now_s: float) -> bool:
        return (
            abs(servo.baudrate - line_speed) <= SPEED_TOLERANCE * servo.baudrate
            and now_s >= servo.silent_until_s
            and not servo.silent
        )

    def _answer(
        self, packet: InstructionPacket, listening: list[Servo], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        if packet.instruction == Instruction.SYNC_READ:
            return self._sync_read(packet, listening, line_speed, end_s)
        if packet.instruction == Instruction.SYNC_WRITE:
            self._sync_write(packet, listening, end_s)
            return ()
        addressed = [s for s in listening if packet.servo_id in (s.servo_id, BROADCAST_ID)]
        answers = [(servo, self._execute(servo, packet, end_s)) for servo in addressed]
        return self._transmit([(s, answer) for s, answer in answers if answer is not None], line_speed)

    def _execute(self, servo: Servo, packet: InstructionPacket, end_s: float) -> bytes | None:
        """Carries out an instruction for one servo; returns its reply, None where it stays silent."""
        servo_id = servo.servo_id
        parameters = packet.parameters
        answers = packet.servo_id != BROADCAST_ID and servo.get("status_level") == 1
        if packet.instruction == Instruction.PING:
            servo.advance(end_s)
            return status_packet(servo_id, servo.status)
        if packet.instruction == Instruction.READ:
            if len(parameters) != 2 or parameters[1] > LARGEST_READ:
                return None
            data = servo.read(parameters[0], parameters[1], end_s)
            return status_packet(servo_id, servo.status, data)
        if packet.instruction == Instruction.WRITE and len(parameters) >= 2:
            servo.write(parameters[0], parameters[1:], end_s)
        elif packet.instruction == Instruction.REG_WRITE and len(parameters) >= 2:
            servo.pending = (parameters[0], parameters[1:])
        elif packet.instruction == Instruction.ACTION:
            pending, servo.pending = servo.pending, None
            if pending is not None:
                servo.write(*pending, end_s)
        elif packet.instruction == Instruction.RESTORE:
            servo.restore(end_s)
        elif packet.instruction in (Instruction.REBOOT, Instruction.RESET):
            servo.power_on(end_s)
        elif packet.instruction == Instruction.OFFSET_CALIBRATION:
            servo.calibrate(int.from_bytes(parameters[:2], "little") if parameters else MIDDLE, end_s)
        else:
            return None
        return status_packet(servo_id, servo.status) if answers else None

    def _sync_read(
        self, packet: InstructionPacket, listening: list[Servo], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        if len(packet.parameters) < 3 or packet.parameters[1] > LARGEST_READ:
            return
        address, length = packet.parameters[:2]
        for servo_id in packet.parameters[2:]:
            group = []
            for servo in listening:
                if servo.servo_id == servo_id:
                    data = servo.read(address, length, end_s)
                    group.append((servo, status_packet(servo_id, servo.status, data)))
            if group:
                yield from self._transmit(group, line_speed)
            else:
                self._wire.reply(length + 6, line_speed, 0.0)  # its slot stays empty

    def _sync_write(self, packet: InstructionPacket, listening: list[Servo], end_s: float) -> None:
        if len(packet.parameters) < 3:
            return
        address, length = packet.parameters[:2]
        rows = packet.parameters[2:]
        for start in range(0, len(rows) - length, length + 1):
            for servo in listening:
                if servo.servo_id == rows[start]:
                    servo.write(address, rows[start + 1 : start + 1 + length], end_s)

    def _transmit(self, answers: list[tuple[Servo, bytes]], line_speed: int) -> Iterable[TimedReply]:
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

    def _record(self, packet: InstructionPacket, now_s: float, end_s: float) -> None:
        name = _NAMES.get(packet.instruction, f"0x{packet.instruction:02x}")
        if packet.instruction in (Instruction.READ, Instruction.SYNC_READ, Instruction.PING):
            self._log.reads += 1
            return
        self._log.add(
            name,
            now_s,
            wire_end_ns=round(end_s * 1e9),
            id=packet.servo_id,
            parameters=packet.parameters.hex(),
        )
