"""A bus of X-series servos: receives instructions of protocol 2.0 and sends timed replies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from joshua_emulator.dynamixel.packets import (
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    InstructionParser,
    ProtocolError,
    fast_status_packet,
    status_packet,
)
from joshua_emulator.dynamixel.servo import Servo
from joshua_emulator.servo_bus.bus import EmulatedServoBus
from joshua_emulator.wire import TimedReply

PING_SLOT_S = (
    0.003  # replies to a broadcast ping come in id order at this interval, as the vendor's SDK expects
)
MULTI_TURN_KEY = b"\x01\x44\x58\x4c\x22"  # parameters of CLEAR

# What FACTORY_RESET leaves of id and baud rate, by its parameter.
_KEPT_BY_RESET = {b"\xff": 0, b"\x01": 1, b"\x02": 2}
_READS = (
    Instruction.READ,
    Instruction.SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.FAST_BULK_READ,
    Instruction.PING,
)
_NAMES = {instruction.value: instruction.name.lower() for instruction in Instruction}


class DynamixelBus(EmulatedServoBus[Servo]):
    """Servos on one cable, nearest to the adapter first."""

    make_parser = InstructionParser
    names = _NAMES
    reads = _READS

    def _answer(
        self, packet: InstructionPacket, listening: list[Servo], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        instruction = packet.instruction
        if instruction in (Instruction.SYNC_READ, Instruction.BULK_READ):
            return self._read_several(_reads(packet), listening, line_speed, end_s)
        if instruction in (Instruction.FAST_SYNC_READ, Instruction.FAST_BULK_READ):
            return self._read_fast(list(_reads(packet)), listening, line_speed, end_s)
        if instruction in (Instruction.SYNC_WRITE, Instruction.BULK_WRITE):
            for servo_id, address, data in _writes(packet):
                for servo in listening:
                    if servo.servo_id == servo_id:
                        servo.write(address, data, end_s)
            return ()
        if packet.servo_id == BROADCAST_ID and instruction == Instruction.PING:
            return self._ping_all(listening, line_speed, end_s)
        addressed = [servo for servo in listening if packet.servo_id in (servo.servo_id, BROADCAST_ID)]
        answers = [(servo, self._execute(servo, packet, end_s)) for servo in addressed]
        return self._transmit([(s, answer) for s, answer in answers if answer is not None], line_speed)

    def _execute(self, servo: Servo, packet: InstructionPacket, end_s: float) -> bytes | None:
        """Execute an instruction on one servo. Return its reply, None if it does not reply."""
        servo_id, parameters = servo.servo_id, packet.parameters
        level = servo.get("status_level")
        answers = packet.servo_id != BROADCAST_ID and level == 2
        if packet.instruction == Instruction.PING:
            servo.advance(end_s)
            return _pong(servo)
        if packet.instruction == Instruction.READ:
            if len(parameters) != 4 or packet.servo_id == BROADCAST_ID or level == 0:
                return None
            error, data = servo.read(_word(parameters), _word(parameters[2:]), end_s)
            return status_packet(servo_id, error | servo.alert, data)
        error = _change(servo, packet, end_s)
        return status_packet(servo_id, error | servo.alert) if answers else None

    def _read_several(
        self, reads: Iterable[tuple[int, int, int]], listening: list[Servo], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        for servo_id, address, length in reads:
            group = []
            for servo in listening:
                if servo.servo_id == servo_id and servo.get("status_level"):
                    error, data = servo.read(address, length, end_s)
                    group.append((servo, status_packet(servo_id, error | servo.alert, data)))
            if group:
                yield from self._transmit(group, line_speed)
            else:
                self._wire.reply(length + 11, line_speed, 0.0)  # its slot stays empty

    def _read_fast(
        self, reads: list[tuple[int, int, int]], listening: list[Servo], line_speed: int, end_s: float
    ) -> Iterable[TimedReply]:
        """Return one packet with the parts of all servos; it ends before the first that does not reply."""
        parts = []
        answering: list[Servo] = []
        for servo_id, address, length in reads:
            servo = next((s for s in listening if s.servo_id == servo_id and s.get("status_level")), None)
            if servo is None:
                break
            error, data = servo.read(address, length, end_s)
            parts.append((servo_id, error | servo.alert, data.ljust(length, b"\0")))
            answering.append(servo)
        if not answering:
            return ()
        reply = fast_status_packet(parts, sum(length + 4 for _, _, length in reads))
        return self._transmit([(answering[0], reply)], line_speed)

    def _ping_all(self, listening: list[Servo], line_speed: int, end_s: float) -> Iterable[TimedReply]:
        free_id = 0
        for servo_id in sorted({servo.servo_id for servo in listening}):
            self._wire.reply(0, line_speed, (servo_id - free_id) * PING_SLOT_S)
            free_id = servo_id
            group = [servo for servo in listening if servo.servo_id == servo_id]
            for servo in group:
                servo.advance(end_s)
            yield from self._transmit([(servo, _pong(servo)) for servo in group], line_speed)


def _pong(servo: Servo) -> bytes:
    return status_packet(servo.servo_id, servo.alert, bytes((*servo.memory[:2], servo.memory[6])))


def _change(servo: Servo, packet: InstructionPacket, end_s: float) -> ProtocolError:
    """Execute an instruction that changes state."""
    parameters = packet.parameters
    if packet.instruction == Instruction.WRITE:
        return servo.write(_word(parameters), parameters[2:], end_s)
    if packet.instruction == Instruction.REG_WRITE:
        servo.pending = (_word(parameters), parameters[2:])
    elif packet.instruction == Instruction.ACTION:
        pending, servo.pending = servo.pending, None
        return servo.write(*pending, end_s) if pending is not None else ProtocolError.RESULT_FAIL
    elif packet.instruction == Instruction.FACTORY_RESET:
        if servo.energised or packet.servo_id == BROADCAST_ID:
            return ProtocolError.RESULT_FAIL
        servo.restore_factory_settings(keep=_KEPT_BY_RESET.get(parameters[:1], 2))
        servo.power_on(end_s)
    elif packet.instruction == Instruction.REBOOT:
        servo.power_on(end_s)
    elif packet.instruction == Instruction.CLEAR and parameters == MULTI_TURN_KEY:
        return servo.clear_turns(end_s)
    else:
        return ProtocolError.INSTRUCTION
    return ProtocolError.NONE


def _reads(packet: InstructionPacket) -> Iterator[tuple[int, int, int]]:
    """Return id, address and length of each requested read."""
    parameters = packet.parameters
    if packet.instruction in (Instruction.SYNC_READ, Instruction.FAST_SYNC_READ):
        for servo_id in parameters[4:]:
            yield servo_id, _word(parameters), _word(parameters[2:])
        return
    for start in range(0, len(parameters) - 4, 5):
        yield parameters[start], _word(parameters[start + 1 :]), _word(parameters[start + 3 :])


def _writes(packet: InstructionPacket) -> Iterator[tuple[int, int, bytes]]:
    """Return id, address and data of each requested write."""
    rows = packet.parameters
    if packet.instruction == Instruction.SYNC_WRITE:
        if len(rows) < 4:
            return
        address, length = _word(rows), _word(rows[2:])
        for start in range(4, len(rows) - length, length + 1):
            yield rows[start], address, rows[start + 1 : start + 1 + length]
        return
    while len(rows) > 5:
        length = _word(rows[3:])
        yield rows[0], _word(rows[1:]), rows[5 : 5 + length]
        rows = rows[5 + length :]


def _word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")
