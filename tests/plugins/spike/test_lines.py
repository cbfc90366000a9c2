"""Lines: whatever comes in whatever pieces, a line is either right or counted as broken."""

from __future__ import annotations

import binascii
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_spike.lines import HubState, Line, LineReader

STATE = Line("S", 0x1F, ("1", "0", "8100", "-12", "90", "-3", "170", "0", "0"))

lines = st.builds(
    Line,
    kind=st.sampled_from("SRMTP?"),
    sequence=st.integers(0, 255),
    words=st.lists(st.from_regex(r"\A[-A-F0-9:]{1,6}\Z"), max_size=8).map(tuple),
)


def read(data: bytes) -> tuple[list[Line | str], int]:
    reader = LineReader()
    return list(reader.feed(data)), reader.corrupt


def test_the_crc_is_the_one_that_is_documented() -> None:
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # the check value of CRC-16/CCITT-FALSE
    assert Line("E", 4).encode() == b"E04*4983\n"


@given(st.lists(lines, max_size=5), st.integers(1, 30))
def test_lines_come_back_from_pieces_of_any_size(sent: list[Line], size: int) -> None:
    data = b"".join(line.encode().replace(b"\n", b"\r\n") for line in sent)
    reader = LineReader()
    found = [line for at in range(0, len(data), size) for line in reader.feed(data[at : at + size])]
    assert found == sent
    assert reader.corrupt == 0


@given(st.binary(max_size=200).filter(lambda data: b"\n" not in data), lines)
def test_a_line_is_found_after_any_garbage(garbage: bytes, line: Line) -> None:
    found, _ = read(garbage + b"\r\n" + line.encode())
    assert found[-1] == line


def test_no_state_is_taken_from_flipped_bits() -> None:
    numbers = random.Random(5)
    wrong = 0
    for _ in range(20_000):
        data = bytearray(STATE.encode())
        for _ in range(numbers.randrange(1, 4)):
            data[numbers.randrange(len(data) - 1)] ^= 1 << numbers.randrange(8)
        found, _ = read(bytes(data))
        wrong += any(isinstance(line, Line) and line != STATE for line in found)
    assert wrong == 0


def test_any_bytes_leave_the_reader_able_to_go_on() -> None:
    numbers = random.Random(6)
    reader = LineReader()
    for _ in range(20_000):
        list(reader.feed(numbers.randbytes(numbers.randrange(40))))
    list(reader.feed(b"\n"))
    assert list(reader.feed(STATE.encode())) == [STATE]


def test_text_of_an_error_is_kept_apart() -> None:
    found, corrupt = read(b"Traceback (most recent call last):\r\nOSError: [Errno 19] ENODEV\r\n")
    assert found == ["Traceback (most recent call last):", "OSError: [Errno 19] ENODEV"]
    assert corrupt == 0


def test_a_state_has_three_numbers_for_each_motor() -> None:
    state = HubState.of(STATE)
    assert (state.energised, state.tripped, state.holding) == (True, False, False)
    assert (state.angles_deg, state.speeds_deg_s, state.loads_mnm) == ((-12, 170), (90, 0), (-3, 0))
    with pytest.raises(ValueError, match="three numbers"):
        HubState.of(Line("S", 1, ("1", "0", "8100", "5")))
