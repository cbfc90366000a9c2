"""Conversions between encoder ticks and radians; free of numpy, so that settings models can use them."""

from __future__ import annotations

import math

TICKS_PER_TURN = 4096


def ticks_to_rad(
    ticks: float, *, ticks_per_turn: int = TICKS_PER_TURN, zero_ticks: float | None = None
) -> float:
    """Convert a position in ticks to radians.

    Args:
        ticks: position.
        ticks_per_turn: ticks in one revolution.
        zero_ticks: position of zero radians; None for the middle of a turn.
    """
    zero = ticks_per_turn / 2 if zero_ticks is None else zero_ticks
    return (ticks - zero) * math.tau / ticks_per_turn


def rad_to_ticks(
    position_rad: float, *, ticks_per_turn: int = TICKS_PER_TURN, zero_ticks: float | None = None
) -> int:
    """Convert a position in radians to the nearest tick. Arguments as for ``ticks_to_rad``."""
    zero = ticks_per_turn / 2 if zero_ticks is None else zero_ticks
    return round(position_rad * ticks_per_turn / math.tau + zero)
