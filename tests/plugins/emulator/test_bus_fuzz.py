"""No instruction, however odd, brings the emulated bus down or makes it answer with a broken packet."""

from hypothesis import given, settings
from hypothesis import strategies as st
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.feetech.bus import FeetechBus
from joshua_emulator.feetech.packets import HEADER, checksum
from joshua_emulator.feetech.servo import Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply

instructions = st.tuples(
    st.sampled_from([1, 2, 254, 7]),
    st.sampled_from([0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x0A, 0x0B, 0x82, 0x83, 0x55]),
    st.one_of(
        st.binary(max_size=12),
        st.tuples(st.integers(0, 90), st.binary(max_size=8)).map(lambda row: bytes((row[0],)) + row[1]),
    ),
)


def make_bus() -> FeetechBus:
    servos = []
    for servo_id in (1, 2):
        servo = Servo(Joint(2048.0), Supply())
        servo.put("id", servo_id)
        servos.append(servo)
    return FeetechBus(servos, EventLog(), Faults())


def packet(servo_id: int, code: int, parameters: bytes) -> bytes:
    body = bytes((servo_id, len(parameters) + 2, code)) + parameters
    return HEADER + body + bytes((checksum(body),))


@settings(max_examples=200, deadline=None)
@given(st.lists(instructions, max_size=12))
def test_any_sequence_of_instructions(sequence: list[tuple[int, int, bytes]]) -> None:
    bus = make_bus()
    due_s = 0.0
    for index, instruction in enumerate(sequence):
        now_s = 10.0 + index * 0.2
        broadcast = instruction[0] == 254
        for reply in bus.receive(packet(*instruction), 1_000_000, now_s):
            assert reply.due_s > max(now_s, due_s)
            due_s = reply.due_s
            assert reply.data[:2] == HEADER
            if not broadcast:  # several answers to a broadcast collide, as on a real line
                assert len(reply.data) == reply.data[3] + 4
                assert checksum(reply.data[2:-1]) == reply.data[-1]


@settings(max_examples=200, deadline=None)
@given(st.lists(st.binary(max_size=30), max_size=10))
def test_any_bytes(chunks: list[bytes]) -> None:
    bus = make_bus()
    for index, chunk in enumerate(chunks):
        bus.receive(chunk, 1_000_000, 10.0 + index)
