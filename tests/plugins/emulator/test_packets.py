from hypothesis import given
from hypothesis import strategies as st
from joshua_emulator.feetech.packets import InstructionParser, checksum, status_packet

bodies = st.tuples(st.integers(0, 254), st.integers(1, 131), st.binary(max_size=40))


def instruction(servo_id: int, code: int, parameters: bytes) -> bytes:
    body = bytes((servo_id, len(parameters) + 2, code)) + parameters
    return b"\xff\xff" + body + bytes((checksum(body),))


def parse(parser: InstructionParser, data: bytes) -> list[tuple[int, int, bytes]]:
    return [(p.servo_id, p.instruction, p.parameters) for p in parser.feed(data)]


def test_the_vendors_example_packets() -> None:
    # read 2 bytes of the present position from id 1, and a reply of 2048
    assert parse(InstructionParser(), bytes.fromhex("ffff0104023802be")) == [(1, 2, b"\x38\x02")]
    assert status_packet(1, 0, (2048).to_bytes(2, "little")) == bytes.fromhex("ffff0104000008f2")


@given(st.lists(bodies, max_size=5), st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_packets_survive_any_cut_into_pieces(packets: list[tuple[int, int, bytes]], cuts: list[int]) -> None:
    stream = b"".join(instruction(*packet) for packet in packets)
    parser, found = InstructionParser(), []
    position = 0
    while position < len(stream):
        size = cuts[position % len(cuts)]
        found += parse(parser, stream[position : position + size])
        position += size
    assert found == packets


@given(st.binary(max_size=20).filter(lambda noise: b"\xff" not in noise), bodies)
def test_noise_before_a_packet_is_skipped_and_counted(noise: bytes, packet: tuple[int, int, bytes]) -> None:
    data = noise + instruction(*packet)
    (found,) = InstructionParser().feed(data)
    assert (found.servo_id, found.instruction, found.parameters) == packet
    assert found.size == len(data)


def test_a_third_header_byte_belongs_to_the_header() -> None:
    assert parse(InstructionParser(), b"\xff" + instruction(3, 1, b"")) == [(3, 1, b"")]


def test_a_broken_checksum_loses_one_packet_only() -> None:
    broken = bytearray(instruction(1, 2, b"\x38\x02"))
    broken[-1] ^= 1
    assert parse(InstructionParser(), bytes(broken) + instruction(2, 1, b"")) == [(2, 1, b"")]
