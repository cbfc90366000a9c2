import dynamixel_sdk as sdk
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_emulator.dynamixel.packets import InstructionParser, crc16, packet, status_packet

# Bytes that make headers, so that stuffing is met often.
AWKWARD = st.lists(st.sampled_from((0xFF, 0xFD, 0x00, 0x07)), max_size=24).map(bytes)
PACKETS = st.tuples(st.integers(0, 252), st.sampled_from((0x01, 0x02, 0x03, 0x83)), AWKWARD)


def vendor_packet(servo_id: int, instruction: int, parameters: bytes) -> bytes:
    """The packet by the vendor's SDK, whose own sending forgets the stuffing that it has worked out."""
    vendor = sdk.Protocol2PacketHandler()
    length = len(parameters) + 3
    head = [0xFF, 0xFF, 0xFD, 0, servo_id, length & 0xFF, length >> 8, instruction]
    whole = bytes(vendor.addStuffing([*head, *parameters, 0, 0]))[:-2]
    return whole + int(vendor.updateCRC(0, whole, len(whole))).to_bytes(2, "little")


def test_the_vendors_example_packets() -> None:
    assert packet(1, 0x01) == bytes.fromhex("FFFFFD0001030001194E")
    assert status_packet(1, 0, bytes.fromhex("060426")) == bytes.fromhex("FFFFFD00010700550006042665 5D")


@given(PACKETS)
def test_stuffing_and_crc_are_those_of_the_vendors_sdk(content: tuple[int, int, bytes]) -> None:
    assert packet(*content) == vendor_packet(*content)


@given(st.lists(PACKETS, min_size=1, max_size=5), st.lists(st.integers(1, 9), min_size=1))
def test_packets_survive_any_cut_into_pieces(packets: list[tuple[int, int, bytes]], cuts: list[int]) -> None:
    stream = b"".join(packet(*content) for content in packets)
    parser = InstructionParser()
    found = []
    at = index = 0
    while at < len(stream):
        step = cuts[index % len(cuts)]
        found += list(parser.feed(stream[at : at + step]))
        at, index = at + step, index + 1
    assert [(p.servo_id, p.instruction, p.parameters) for p in found] == packets


@given(st.binary(max_size=30))
def test_noise_before_a_packet_is_skipped(noise: bytes) -> None:
    parser = InstructionParser()
    found = list(parser.feed(noise + packet(1, 0x01) + bytes(1100)))  # more than any length that noise claims
    assert (1, 0x01) in [(p.servo_id, p.instruction) for p in found]


def test_a_broken_crc_loses_one_packet_only() -> None:
    broken = bytearray(packet(1, 0x01))
    broken[-1] ^= 1
    found = list(InstructionParser().feed(bytes(broken) + packet(2, 0x01)))
    assert [p.servo_id for p in found] == [2]


@pytest.mark.parametrize("data", [b"", b"\x00", b"123456789"])
def test_the_crc_is_the_vendors(data: bytes) -> None:
    assert crc16(data) == sdk.Protocol2PacketHandler().updateCRC(0, data, len(data))
