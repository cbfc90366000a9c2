from collections.abc import Callable

import pytest
from joshua.devices.patience import Patience, machine_is_busy


def idle() -> bool:
    return False


def busy() -> bool:
    return True


def silence(patience: Patience, *, period_s: float) -> float:
    """How long readings may stay away that are tried at this distance."""
    now_s = 10.0
    while patience.miss(now_s, now_s + 0.02):
        now_s += period_s
    return now_s + 0.02 - 10.0


@pytest.mark.parametrize(
    ("machine", "period_s", "limit_s"),
    [
        (idle, 0.04, 0.4),
        (idle, 0.2, 0.8),  # five readings at least: the driver is held up itself
        (idle, 2.0, 2.0),  # a slow loop reads at least twice
        (busy, 0.04, 1.0),
    ],
)
def test_a_silence_is_borne_up_to_its_limit(
    machine: Callable[[], bool], period_s: float, limit_s: float
) -> None:
    patience = Patience(0.4, busy=machine)
    assert silence(patience, period_s=period_s) == pytest.approx(limit_s, abs=0.05)


def test_an_answer_ends_a_silence_and_says_how_long_it_was() -> None:
    patience = Patience(0.4, busy=idle)
    assert patience.hear(9.0) == 0.0
    patience.miss(10.0, 10.1)
    assert patience.hear(10.12) == pytest.approx(0.12)
    assert silence(patience, period_s=0.04) == pytest.approx(0.4, abs=0.05), "a new silence, a new limit"
    assert patience.longest_s == pytest.approx(0.12)


def test_a_machine_can_be_asked() -> None:
    assert machine_is_busy() in (True, False)
