"""The hand of an emulated arm waits for the eye."""

from __future__ import annotations

import pytest
from joshua_emulator.servo_bus.watched_hand import LOOK_S, WatchedTime


class Bus:
    reads = 7
    away_s = 0.0


@pytest.fixture
def bus() -> Bus:
    return Bus()


@pytest.fixture
def hand(bus: Bus) -> WatchedTime:
    return WatchedTime(100.0, lambda: bus.reads, lambda now_s: bus.away_s)


def test_it_keeps_up_with_whoever_reads_often(bus: Bus, hand: WatchedTime) -> None:
    for number in range(1, 51):
        bus.reads += 1
        assert hand(100.0 + 0.01 * number) == pytest.approx(0.01 * number)


def test_it_rests_while_nobody_reads(bus: Bus, hand: WatchedTime) -> None:
    bus.reads += 1
    assert hand(100.5) == pytest.approx(LOOK_S)
    assert hand(103.0) == pytest.approx(LOOK_S), "a look over the control channel is none of the reader's"
    bus.reads += 1
    assert hand(103.1) == pytest.approx(2 * LOOK_S)
    assert hand(103.05) == pytest.approx(2 * LOOK_S), "time does not run backwards"


def test_before_the_first_read_every_look_counts(hand: WatchedTime) -> None:
    assert hand(100.01) == pytest.approx(0.01)
    assert hand(105.0) == pytest.approx(0.01 + LOOK_S)
    assert hand(105.01) == pytest.approx(0.02 + LOOK_S)


def test_it_goes_on_while_the_adapter_is_away(bus: Bus, hand: WatchedTime) -> None:
    bus.reads += 1
    hand(100.01)
    bus.away_s = 1.5
    bus.reads += 1
    assert hand(102.0) == pytest.approx(0.01 + 1.5 + LOOK_S)
