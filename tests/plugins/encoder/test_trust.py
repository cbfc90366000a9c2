"""Answers with weak check bits: what counts on a line that damages them, and what a good line costs."""

from __future__ import annotations

import random

import pytest
from joshua_emulator.encoder.device import amt21_answer
from joshua_encoder.amt21 import position
from joshua_encoder.trust import TRUST_RUN, Trust

RESOLUTION = 16384
ASK_S = 0.0003
ROUND_S = 0.01
ROUNDS = 100_000


def run(
    speed: float, damage: float, rounds: int, start: int = 9000
) -> tuple[list[tuple[int, int]], int, int]:
    """Rounds on a shaft of a speed in counts a second; counts with the truth, asks, undetected damages."""
    draw, trust = random.Random(4), Trust(RESOLUTION)
    counted, asks, passed = [], 0, 0
    for number in range(rounds):
        trust.begin()
        for attempt in range(6):
            time_s = number * ROUND_S + attempt * ASK_S
            true = int(start + speed * time_s) % RESOLUTION
            answer = bytearray(amt21_answer(true, RESOLUTION))
            for place in range(2):
                if draw.random() < damage:
                    answer[place] ^= draw.randrange(1, 256)
            asks += 1
            count = position(bytes(answer), RESOLUTION)
            if count is None:
                trust.damaged()
                continue
            passed += count != true
            if trust.take(count, time_s):
                counted.append((count, true))
                break
    return counted, asks, passed


def wrong(counted: list[tuple[int, int]], speed: float) -> list[tuple[int, int]]:
    """Those farther from the truth than the noise of an encoder and the motion of a millisecond."""
    return [pair for pair in counted if abs(pair[0] - pair[1]) > 3 + abs(speed) * 0.001]


def test_no_wrong_count_from_a_line_that_flips_one_byte_in_a_hundred() -> None:
    counted, _, passed = run(0.0, 0.01, 20_000)
    assert passed > 100  # the check bits alone would have let them through
    assert wrong(counted, 0.0) == []
    assert len(counted) > 0.999 * 20_000


@pytest.mark.parametrize("speed", [-900.0, 12_000.0, 400_000.0])
def test_a_turning_shaft_is_followed_on_a_bad_line(speed: float) -> None:
    counted, _, passed = run(speed, 0.01, 5_000)
    assert passed > 20
    assert len(counted) > 0.99 * 5_000
    assert wrong(counted, speed) == []


def test_a_good_line_is_asked_once_after_a_while() -> None:
    counted, asks, _ = run(3_000.0, 0.0, 2_000)
    assert len(counted) == 2_000
    assert asks <= 2_000 + TRUST_RUN


def test_a_single_damage_brings_the_doubt_back() -> None:
    trust = Trust(RESOLUTION)
    for number in range(TRUST_RUN + 1):
        trust.begin()
        trust.take(100, number * 1.0)
    trust.begin()
    assert trust.take(100, 1000.0)
    trust.damaged()
    assert not trust.take(8000, 1000.001)
    assert not trust.take(100, 1000.002)
    assert trust.take(100, 1000.003)


def test_a_slow_adapter_keeps_its_rate_until_the_line_shows_damage() -> None:
    trust = Trust(RESOLUTION)
    for number in range(5):
        trust.begin()
        assert trust.take(100, number * 0.02, hurried=True)
    trust.damaged()
    assert not trust.take(8000, 0.1, hurried=True)


def test_random_answers_break_nothing() -> None:
    draw, trust = random.Random(5), Trust(RESOLUTION)
    for number in range(ROUNDS):
        count = position(draw.randbytes(2), RESOLUTION)
        if count is None:
            trust.damaged()
        else:
            trust.take(count, number * ASK_S)
    assert [trust.take(7, ROUNDS + number) for number in range(3)][-1]
