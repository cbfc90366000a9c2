"""A bus of servos: receives instructions and sends timed replies."""

from __future__ import annotations

from collections.abc import Iterable

from joshua_emulator.feetech.packets import (
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    InstructionParser,
    status_packet,
)
from joshua_emulator.feetech.servo import MIDDLE, Servo
from joshua_emulator.servo_bus.bus import EmulatedServoBus
from joshua_emulator.wire import TimedReply

LARGEST_READ = 250  # bytes of a reply; the length byte of a packet holds no more

_READS = (Instruction.READ, Instruction.SYNC_READ, Instruction.PING)
_NAMES = {instruction.value: instruction.name.lower() for instruction in Instruction}


class FeetechBus(EmulatedServoBus[Servo]):
    """Servos on one cable, nearest to the adapter first."""

    make_parser = InstructionParser
    names = _NAMES
    reads = _READS

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
        """Execute an instruction on one servo. Return its reply, None if it does not reply."""
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
