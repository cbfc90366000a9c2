"""The estimate of when the next message arrives: from arrivals that are regular, lost, late or at random."""

from __future__ import annotations

import random

import pytest
from joshua.devices.arrival_phase import FIRST_ARRIVALS, ArrivalPhase

MS = 1_000_000


def phase_of(arrivals_ms: list[float]) -> ArrivalPhase:
    phase = ArrivalPhase()
    for arrival_ms in arrivals_ms:
        phase.arrived(round(arrival_ms * MS))
    return phase


def test_regular_arrivals_are_known_after_the_first_few() -> None:
    phase = phase_of([3.0 + 10.0 * number for number in range(FIRST_ARRIVALS)])
    assert phase.interval_ns == pytest.approx(10 * MS)
    assert phase.nearest_ns(1_000 * MS) == pytest.approx(1_003 * MS)
    assert phase_of([3.0, 13.0, 23.0, 33.0]).interval_ns == 0


def test_lost_messages_change_nothing() -> None:
    numbers = [0, 1, 3, 4, 5, 7, 8, 9, 12, 13]
    phase = phase_of([10.0 * number for number in numbers])
    assert phase.interval_ns == pytest.approx(10 * MS)
    assert phase.nearest_ns(204 * MS) == pytest.approx(200 * MS)


def test_messages_that_a_stall_delivers_at_once_change_nothing() -> None:
    regular = [10.0 * number for number in range(20)]
    stalled = [393.0 + 0.01 * number for number in range(20)]
    phase = phase_of([*regular, *stalled, 400.0, 410.0])
    assert phase.interval_ns == pytest.approx(10 * MS)
    assert phase.nearest_ns(500 * MS) == pytest.approx(500 * MS)


def test_the_error_of_the_interval_falls_as_arrivals_come() -> None:
    generator = random.Random(1)
    arrivals_ms = [10.0 * number + generator.uniform(0.0, 1.0) for number in range(100)]
    phase = phase_of(arrivals_ms)
    assert phase.interval_ns == pytest.approx(10 * MS, rel=0.005)
    assert phase.nearest_ns(1_000 * MS) == pytest.approx(1_000.5 * MS, abs=0.4 * MS)


@pytest.mark.parametrize("step_ms", [3.0, 5.0, 7.0])
def test_a_sender_that_starts_anew_is_followed_again(step_ms: float) -> None:
    before = [10.0 * number for number in range(40)]
    after = [400.0 + step_ms + 10.0 * number for number in range(40)]
    phase = phase_of([*before, *after])
    assert phase.nearest_ns(900 * MS) % (10 * MS) == pytest.approx(step_ms * MS, abs=0.2 * MS)


def test_arrivals_at_random_times_are_followed_for_a_short_time_only() -> None:
    generator = random.Random(2)
    phase = ArrivalPhase()
    at_ns = 0
    known = 0
    for _ in range(2_000):
        at_ns += round(generator.expovariate(0.1) * MS)
        phase.arrived(at_ns)
        known += phase.interval_ns > 0
    assert known < 1_000
