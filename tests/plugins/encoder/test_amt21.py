"""The AMT21's answers: the example of its data sheet, all positions, and damages."""

from __future__ import annotations

import pytest
from joshua_emulator.encoder.device import amt21_answer
from joshua_encoder.amt21 import position


def test_the_example_of_the_data_sheet() -> None:
    assert position(bytes.fromhex("ab61"), 16384) == 0x21AB


@pytest.mark.parametrize("resolution", [4096, 16384])
def test_every_position(resolution: int) -> None:
    for count in range(resolution):
        assert position(amt21_answer(count, resolution), resolution) == count


@pytest.mark.parametrize("resolution", [4096, 16384])
def test_every_single_flipped_bit_is_noticed(resolution: int) -> None:
    for count in range(0, resolution, 37):
        answer = amt21_answer(count, resolution)
        for place in range(16):
            damaged = (int.from_bytes(answer, "little") ^ 1 << place).to_bytes(2, "little")
            assert position(damaged, resolution) is None


@pytest.mark.parametrize("answer", [b"", b"\x00", b"\x00\x00", b"\xff\xff\xff"])
def test_what_is_no_answer(answer: bytes) -> None:
    assert position(answer, 16384) is None


def test_an_encoder_of_14_bits_does_not_pass_for_one_of_12() -> None:
    assert position(amt21_answer(0x21AB, 16384), 4096) is None
