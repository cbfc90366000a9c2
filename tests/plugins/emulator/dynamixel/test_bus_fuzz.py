"""No instruction, however odd, brings the emulated bus down or makes it answer with a broken packet."""

from hypothesis import given, settings
from hypothesis import strategies as st
from joshua_emulator.dynamixel.bus import DynamixelBus
from joshua_emulator.dynamixel.models import MODELS
from joshua_emulator.dynamixel.packets import HEADER, crc16, packet
from joshua_emulator.dynamixel.servo import Servo
from joshua_emulator.event_log import EventLog
from joshua_emulator.faults import Faults
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply

addresses = st.one_of(st.integers(0, 150), st.integers(0, 0xFFFF)).map(
    lambda value: value.to_bytes(2, "little")
)
instructions = st.tuples(
    st.sampled_from([1, 2, 254, 7]),
    st.sampled_from([0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x10, 0x55, 0x82, 0x83, 0x92, 0x93, 0x8A]),
    st.one_of(
        st.binary(max_size=16),
        st.tuples(addresses, st.binary(max_size=8)).map(b"".join),
        st.tuples(addresses, addresses, st.sampled_from([b"\x01", b"\x01\x02", b"\x02\x07"])).map(b"".join),
    ),
)


def make_bus() -> DynamixelBus:
    servos = []
    for servo_id, model in ((1, "xl330-m077"), (2, "xm430-w350")):
        servo = Servo(MODELS[model], Joint(2048.0), Supply(MODELS[model].volts))
        servo.put("id", servo_id)
        servo.put("baudrate", 3)
        servos.append(servo)
    return DynamixelBus(servos, EventLog(), Faults())


FAST_READS = (0x8A, 0x9A)


@settings(max_examples=200, deadline=None)
@given(st.lists(instructions, max_size=12))
def test_any_sequence_of_instructions(sequence: list[tuple[int, int, bytes]]) -> None:
    bus = make_bus()
    due_s = 0.0
    for index, instruction in enumerate(sequence):
        now_s = 10.0 + index
        ids = {servo.servo_id for servo in bus.servos}
        for reply in bus.receive(packet(*instruction), 1_000_000, now_s):
            assert reply.due_s > max(now_s, due_s)
            due_s = reply.due_s
            # two servos of one id collide, as on a real line; a fast read is one packet in parts
            if len(ids) == len(bus.servos) and instruction[1] not in FAST_READS:
                assert reply.data[:4] == HEADER
                assert len(reply.data) == int.from_bytes(reply.data[5:7], "little") + 7
                assert crc16(reply.data[:-2]) == int.from_bytes(reply.data[-2:], "little")


@settings(max_examples=200, deadline=None)
@given(st.lists(st.binary(max_size=30), max_size=10))
def test_any_bytes(chunks: list[bytes]) -> None:
    bus = make_bus()
    for index, chunk in enumerate(chunks):
        bus.receive(chunk, 1_000_000, 10.0 + index)
