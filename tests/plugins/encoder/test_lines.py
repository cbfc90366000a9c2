"""Lines of counts: what is read, from any place on, and what is refused."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_emulator.encoder import device
from joshua_encoder.lines import LineParser, crc8

ROUNDS = 100_000


def counts(data: bytes, size: int = 0, largest: int | None = None) -> list[int]:
    parser = LineParser(largest)
    step = size or max(1, len(data))
    pieces = (data[start : start + step] for start in range(0, len(data), step))
    return [count.count for piece in pieces for count in parser.feed(piece)]


@pytest.mark.parametrize(
    ("line", "count", "time_us", "status"),
    [
        (b"42", 42, None, None),
        (b"-7\r", -7, None, None),
        (b"+9", 9, None, None),
        (b" 12 , 3400 ", 12, 3400, None),
        (b"12;3400", 12, 3400, None),
        (b"4095,17,32", 4095, 17, 32),
        (b"1234,5678*" + f"{crc8(b'1234,5678'):02x}".encode(), 1234, 5678, None),
    ],
)
def test_the_forms_of_a_line(line: bytes, count: int, time_us: int | None, status: int | None) -> None:
    (read,) = LineParser().feed(b"\n" + line + b"\n")
    assert (read.count, read.time_us, read.status) == (count, time_us, status)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"x",
        b"1.5",
        b"12,",
        b"1,2,3,4",
        b"--3",
        b"0x12",
        b"12*",
        b"12*G0",
        b"1" * 21,
        b"12\x00",
        b"\xff\xfe",
    ],
)
def test_what_is_no_line(line: bytes) -> None:
    assert LineParser().feed(b"\n" + line + b"\n") == []


def test_the_crc_is_that_of_its_check_value() -> None:
    assert crc8(b"123456789") == 0xF4  # CRC-8/SMBUS
    assert device.crc8(b"123456789") == 0xF4


def test_a_sender_that_has_shown_a_crc_must_go_on() -> None:
    good = f"5*{crc8(b'5'):02X}".encode()
    assert counts(b"\n" + good + b"\n6\n" + good + b"\n") == [5, 5]
    assert counts(b"\n6\n" + good + b"\n") == [6, 5]


def test_the_first_line_may_be_the_end_of_one() -> None:
    assert counts(b"34\n1235\n1236\n") == [1235, 1236]


def test_counts_beyond_the_largest_are_refused() -> None:
    assert counts(b"\n4096\n4095\n-1\n0\n", largest=4095) == [4095, 0]


@given(st.binary(max_size=400), st.integers(1, 50))
def test_every_line_is_found_after_any_prefix(prefix: bytes, size: int) -> None:
    lines = b"".join(f"{number},{number * 100}\n".encode() for number in range(1000, 1040))
    found = counts(prefix + b"\n" + lines, size)
    assert found[-40:] == list(range(1000, 1040))


@pytest.mark.parametrize("how", ["any", "inverted", "one bit"])
def test_no_wrong_count_from_a_line_with_crc_that_flips_one_byte_in_a_hundred(how: str) -> None:
    draw = random.Random(8)
    sent, data = set(), bytearray(b"\n")
    for number in range(10_000):
        text = f"{number},{number * 5000}"
        sent.add((number, number * 5000))
        data += f"{text}*{crc8(text.encode()):02X}\n".encode()
    clean = LineParser().feed(bytes(data))
    assert len(clean) == 10_000
    for place in range(len(data)):
        if draw.random() < 0.01:
            masks = {"any": draw.randrange(1, 256), "inverted": 0xFF, "one bit": 1 << draw.randrange(8)}
            data[place] ^= masks[how]
    parser = LineParser()
    found = parser.feed(bytes(data))
    wrong = [count for count in found if (count.count, count.time_us) not in sent]
    assert parser.bad > 1000
    assert wrong == []


def test_random_buffers_break_nothing() -> None:
    draw = random.Random(2)
    parser = LineParser(4095)
    for _ in range(ROUNDS):
        for count in parser.feed(draw.randbytes(draw.randrange(64))):
            assert 0 <= count.count <= 4095
    assert [count.count for count in parser.feed(b"\n17\n")] == [17]
