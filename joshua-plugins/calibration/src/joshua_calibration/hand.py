"""Motions of a calibration as paths over time, for emulated and simulated devices."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

Path = Callable[[float], float]  # seconds since the start to radians


def hand_paths(
    joint: int | None, present: Sequence[float], ranges: Sequence[tuple[float, float]], seconds: float
) -> dict[int, Path]:
    """Return one motion of a calibration: all joints to their middles, or one through its range.

    Args:
        joint: the joint that moves to its low stop, high stop and middle while the others stay in place; None
            moves all to their middles.
        present: joint positions; ranges: mechanical ranges, in radians about the same zero.
        seconds: duration.

    Raises:
        ValueError: ``seconds`` is not positive.
    """
    if not math.isfinite(seconds) or seconds <= 0:
        raise ValueError(f"seconds is {seconds}; it must be above 0")
    middles = [(low + high) / 2 for low, high in ranges]

    def make(corners: list[tuple[float, float]]) -> Path:
        points = [(share * seconds, value) for share, value in corners]
        return lambda time_s: interpolate(points, time_s)

    if joint is None:
        return {index: make([(0.0, present[index]), (0.8, middle)]) for index, middle in enumerate(middles)}
    low, high = ranges[joint]
    return {
        joint: make(
            [(0.0, present[joint]), (0.3, low), (0.35, low), (0.7, high), (0.75, high), (1.0, middles[joint])]
        )
    }


def interpolate(points: Sequence[tuple[float, float]], time_s: float) -> float:
    """Interpolate sorted (time, value) points; the first and last value hold beyond them."""
    if time_s <= points[0][0]:
        return points[0][1]
    for (start_s, start), (end_s, end) in pairwise(points):
        if time_s <= end_s:
            return start + (end - start) * (time_s - start_s) / (end_s - start_s)
    return points[-1][1]
