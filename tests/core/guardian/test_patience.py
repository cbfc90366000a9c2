"""How long a device that does not answer is borne, and what then may be claimed about it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.guardian.silence import LEAST_MISSES, PATIENCE_FACTOR, SILENCE_LIMIT_S, Patience


class Device:
    """A device that is asked at a given distance, and the patience with it."""

    def __init__(self, period_s: float = 0.0) -> None:
        self.now_s = 10.0
        self.waited_s = 0.0
        self.patience = Patience(period_s=period_s, clock=lambda: self.now_s, waited=lambda: self.waited_s)

    def miss(self, *, takes_s: float = 0.02) -> bool:
        self.patience.begin()
        self.now_s += takes_s
        return self.patience.miss()

    def hear(self) -> float:
        self.patience.begin()
        self.now_s += 0.02
        return self.patience.hear()

    def silence(self, *, period_s: float) -> float:
        """How long requests may stay unanswered that are sent at this distance."""
        began_s = self.now_s
        while self.miss():
            self.now_s += period_s - 0.02
        return self.now_s - began_s


@pytest.mark.parametrize(
    ("period_s", "limit_s"),
    [
        (0.02, 0.4),
        (0.04, 0.4),
        (0.2, 1.0),  # the driver is held up itself
    ],
)
def test_a_silence_is_borne_up_to_its_limit(period_s: float, limit_s: float) -> None:
    device = Device()
    assert device.silence(period_s=period_s) == pytest.approx(limit_s, abs=0.05)
    assert device.patience.is_silent


@pytest.mark.parametrize("period_s", [0.5, 2.0])
def test_a_slow_loop_asks_at_least_twice(period_s: float) -> None:
    device = Device(period_s)
    assert device.silence(period_s=period_s) == pytest.approx(period_s, abs=0.05)
    assert device.patience.is_silent
    assert device.patience.misses == 2


def test_a_machine_that_stands_still_during_a_request_is_no_fault_of_the_device() -> None:
    device = Device()
    assert device.miss(takes_s=30.0)
    assert device.hear() == pytest.approx(30.02)


def test_time_in_a_run_queue_does_not_count() -> None:
    """Short stalls, none of which is longer than a request may count."""
    device = Device()
    device.miss()
    while device.patience.gap_s < SILENCE_LIMIT_S * PATIENCE_FACTOR - 0.1:
        device.now_s += 0.06
        device.waited_s += 0.06
        assert device.miss(takes_s=0.01), "of seven parts, one was awake"
    assert not device.patience.is_silent
    assert device.patience.delayed_s > 1.5


def test_a_machine_that_stays_busy_ends_the_patience_and_blames_nobody() -> None:
    device = Device()
    while device.miss(takes_s=0.01):
        device.now_s += 0.09
        device.waited_s += 0.09
    assert device.patience.gap_s == pytest.approx(SILENCE_LIMIT_S * PATIENCE_FACTOR, abs=0.1)
    assert not device.patience.is_silent


def test_an_answer_ends_a_silence_and_says_how_long_it_was() -> None:
    device = Device()
    assert device.hear() == 0.0
    assert device.miss(takes_s=0.1)
    assert device.hear() == pytest.approx(0.12)
    assert device.silence(period_s=0.04) == pytest.approx(0.4, abs=0.05), "a new silence, a new limit"


@given(
    st.lists(st.tuples(st.floats(0.001, 0.08), st.floats(0.0, 3.0), st.booleans()), min_size=1, max_size=40)
)
def test_a_device_is_blamed_only_after_its_time(steps: list[tuple[float, float, bool]]) -> None:
    """Requests of any length, with stalls of any length before or during each, in a run queue or stopped."""
    device = Device()
    for takes_s, stall_s, in_queue in steps:
        device.now_s += stall_s
        device.waited_s += stall_s * in_queue
        tolerated = device.miss(takes_s=takes_s)
        patience = device.patience
        assert patience.awake_s <= patience.gap_s + 1e-9
        if patience.is_silent:
            assert patience.misses >= LEAST_MISSES
        if not tolerated:
            assert patience.misses >= LEAST_MISSES
            assert patience.is_silent or patience.gap_s >= SILENCE_LIMIT_S * PATIENCE_FACTOR
            return
