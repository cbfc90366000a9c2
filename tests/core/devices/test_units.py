from __future__ import annotations

import math

import pytest
from joshua.devices.units import rad_to_ticks, ticks_to_rad


def test_zero_is_the_middle_of_a_turn() -> None:
    assert ticks_to_rad(2048) == 0.0
    assert ticks_to_rad(0) == pytest.approx(-math.pi)
    assert ticks_to_rad(3072) == pytest.approx(math.pi / 2)


def test_resolution_and_zero_can_be_others() -> None:
    assert ticks_to_rad(100, ticks_per_turn=400, zero_ticks=0) == pytest.approx(math.pi / 2)
    assert rad_to_ticks(math.pi / 2, ticks_per_turn=400, zero_ticks=0) == 100


@pytest.mark.parametrize("ticks", [0, 1, 2047, 2048, 4095])
def test_conversion_back_gives_the_same_tick(ticks: int) -> None:
    assert rad_to_ticks(ticks_to_rad(ticks)) == ticks
