"""How long a device that does not answer is borne."""

from __future__ import annotations

import pytest
from joshua.devices.actuator_status import Patience


class Device:
    """A device that is read at a given distance, and the patience with it."""

    def __init__(self) -> None:
        self.now_s = 10.0
        self.patience = Patience(0.4, lambda: self.now_s)

    def miss(self, *, takes_s: float = 0.02) -> bool:
        self.patience.begin()
        self.now_s += takes_s
        return self.patience.miss()

    def hear(self) -> float:
        self.patience.begin()
        self.now_s += 0.02
        return self.patience.hear()

    def silence(self, *, period_s: float) -> float:
        """How long readings may stay away that are tried at this distance."""
        began_s = self.now_s
        while self.miss():
            self.now_s += period_s - 0.02
        return self.now_s - began_s


@pytest.mark.parametrize(
    ("period_s", "limit_s"),
    [
        (0.04, 0.4),
        (0.2, 0.8),  # the driver is held up itself
        (2.0, 2.0),  # a slow loop reads at least twice
    ],
)
def test_a_silence_is_borne_up_to_its_limit(period_s: float, limit_s: float) -> None:
    assert Device().silence(period_s=period_s) == pytest.approx(limit_s, abs=0.05)


def test_a_machine_that_stands_still_during_a_reading_is_no_fault_of_the_device() -> None:
    device = Device()
    assert device.miss(takes_s=30.0)
    assert device.hear() == pytest.approx(30.02)


def test_an_answer_ends_a_silence_and_says_how_long_it_was() -> None:
    device = Device()
    assert device.hear() == 0.0
    assert device.miss(takes_s=0.1)
    assert device.hear() == pytest.approx(0.12)
    assert device.silence(period_s=0.04) == pytest.approx(0.4, abs=0.05), "a new silence, a new limit"
    assert device.patience.longest_s == pytest.approx(0.12)
