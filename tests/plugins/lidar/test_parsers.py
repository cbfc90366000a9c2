"""The parsers: what they read, from any place of a stream on, and what they refuse."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joshua_emulator.lidar.room import distances_m
from joshua_lidar.parsers.ld06 import Ld06Parser
from joshua_lidar.parsers.ydlidar import YdlidarParser
from joshua_lidar.samples import Samples
from lidar_streams import PROTOCOLS, Protocol, keys, parse

each_protocol = pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=PROTOCOLS)
CHECKED = {name: protocol for name, protocol in PROTOCOLS.items() if protocol.checksum}
each_checked = pytest.mark.parametrize("protocol", CHECKED.values(), ids=CHECKED)

PACKETS = 100
ROUNDS = 100_000


def clean(protocol: Protocol, count: int = PACKETS) -> tuple[bytes, Samples]:
    data = b"".join(protocol.pieces(count))
    return data, parse(protocol.parser(), data)


@each_protocol
def test_measurements_are_those_of_the_room(protocol: Protocol) -> None:
    _, samples = clean(protocol)
    assert len(samples) >= (PACKETS - protocol.lag) * protocol.stream.points
    truth = distances_m(samples.angle_rad)
    wrong = np.abs(samples.range_m - truth)
    # at an edge a step of the angle is a step of the distance
    assert np.median(wrong) < 0.005
    assert np.mean(wrong < 0.05) > 0.97


@each_protocol
@pytest.mark.parametrize("size", [1, 7, 46, 1000])
def test_pieces_of_any_size_give_the_same(protocol: Protocol, size: int) -> None:
    data, whole = clean(protocol)
    pieces = parse(protocol.parser(), data, size)
    assert keys(pieces) == keys(whole)
    np.testing.assert_array_equal(pieces.end, whole.end)


@pytest.mark.parametrize("name", PROTOCOLS)
@settings(max_examples=60, deadline=None)
@given(prefix=st.binary(max_size=700), cut=st.integers(0, 90))
def test_every_packet_is_found_after_any_prefix(name: str, prefix: bytes, cut: int) -> None:
    protocol = PROTOCOLS[name]
    pieces = protocol.pieces(PACKETS)
    whole = parse(protocol.parser(), b"".join(pieces))
    size = len(pieces[0])
    tail = pieces[0][size - min(cut, size // 2) :] if cut else b""  # of which no prefix makes a packet
    noise = prefix + (tail if protocol.checksum else b"")
    parser = protocol.parser()
    found = parse(parser, noise + b"".join(pieces), 61)
    assert keys(found)[-len(whole) :] == keys(whole)
    if protocol.checksum:
        assert len(found) == len(whole)
        np.testing.assert_array_equal(found.end - len(noise), whole.end)


@each_protocol
def test_a_long_prefix_of_noise_loses_nothing(protocol: Protocol) -> None:
    noise = random.Random(5).randbytes(100_000)
    data, whole = clean(protocol)
    found = parse(protocol.parser(), noise + data, 256)
    assert keys(found)[-len(whole) :] == keys(whole)


@each_checked
@pytest.mark.parametrize("how", ["any", "inverted", "one bit"])
def test_no_wrong_measurement_from_a_line_that_flips_one_byte_in_a_hundred(
    protocol: Protocol, how: str
) -> None:
    draw = random.Random(11)
    pieces = protocol.pieces(20_000)
    data = bytearray(b"".join(pieces))
    truth = set(keys(parse(protocol.parser(), bytes(data))))
    for place in range(len(data)):
        if draw.random() < 0.01:
            masks = {"any": draw.randrange(1, 256), "inverted": 0xFF, "one bit": 1 << draw.randrange(8)}
            data[place] ^= masks[how]
    parser = protocol.parser()
    found = keys(parse(parser, bytes(data), 4096))
    assert [key for key in found if key not in truth] == []
    assert parser.damaged > 1000


@each_checked
def test_a_single_damaged_packet_costs_itself_only(protocol: Protocol) -> None:
    pieces = protocol.pieces(200)
    whole = parse(protocol.parser(), b"".join(pieces))
    broken = bytearray(pieces[120])
    broken[-1] ^= 0x10
    parser = protocol.parser()
    found = parse(parser, b"".join([*pieces[:120], bytes(broken), *pieces[121:]]))
    assert parser.damaged == 1
    lost = len(whole) - len(found)
    assert 0 < lost <= (1 + protocol.lag) * (protocol.stream.points + 1)
    assert set(keys(found)) <= set(keys(whole))


@each_checked
def test_random_buffers_bring_nothing_and_break_nothing(protocol: Protocol) -> None:
    draw = random.Random(3)
    parser = protocol.parser()
    for _ in range(ROUNDS):
        assert len(parser.feed(draw.randbytes(draw.randrange(64)))) == 0
    data, whole = clean(protocol)
    assert len(parse(parser, data)) == len(whole)


def test_random_buffers_do_not_break_the_standard_scan() -> None:
    draw = random.Random(3)
    protocol = PROTOCOLS["rplidar_standard"]
    parser = protocol.parser()
    found = 0
    for _ in range(ROUNDS):
        found += len(parser.feed(draw.randbytes(draw.randrange(64))))
    assert found == 0
    data, whole = clean(protocol)
    assert len(parse(parser, data)) >= len(whole)


def test_the_standard_scan_finds_its_step_again_after_a_lost_byte() -> None:
    protocol = PROTOCOLS["rplidar_standard"]
    data, whole = clean(protocol)
    parser = protocol.parser()
    found = parse(parser, data[:2002] + data[2003:])
    assert parser.damaged == 1
    assert len(whole) - 8 <= len(found) < len(whole)
    wrong = set(keys(found)) - set(keys(whole))
    assert len(wrong) <= 1  # the node that the byte is missing from has no checksum


def test_ld06_reads_the_packet_of_its_manual() -> None:
    # the example of the LD06's development manual
    packet = bytes.fromhex(
        "542c6808ab7ee000e4dc00e2d900e5d500e3d300e4d000e9cd00e4ca00e2c700e9c500e5c200e5c000e5be823a1a50"
    )
    samples = Ld06Parser(trust_run=1).feed(packet)
    assert len(samples) == 12
    np.testing.assert_allclose(np.degrees(-samples.angle_rad[[0, -1]]), [324.27, 334.70], atol=0.01)
    np.testing.assert_allclose(samples.range_m[:2], [0.224, 0.220])
    assert samples.intensity[0] == 228


def test_ydlidar_corrects_angles_as_its_manual_does() -> None:
    # first sample of the example in the X4's development manual: 1000 mm away at 215.3 degrees
    from joshua_emulator.lidar.packets import ydlidar

    samples = YdlidarParser(trust_run=1).feed(ydlidar(223.78, 243.47, np.array([8000.0, 1000.0])))
    np.testing.assert_allclose(np.degrees(-samples.angle_rad), [223.78 - 7.8374, 243.47 - 6.7628], atol=0.05)
