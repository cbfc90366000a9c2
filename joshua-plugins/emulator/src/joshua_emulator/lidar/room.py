"""The room that emulated scanners stand in: walls with a door, a round column, a box and a person's legs."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]

# Metres; the scanner stands at the origin, x ahead, y to the left. Walls and sides: x0, y0, x1, y1.
WALLS = (
    (3.2, -1.8, 3.2, 0.4),
    (3.2, 1.3, 3.2, 2.4),  # the door between 0.4 and 1.3 stands open
    (3.2, 2.4, -2.4, 2.4),
    (-2.4, 2.4, -2.4, -1.8),
    (-2.4, -1.8, 3.2, -1.8),
    (3.2, 0.4, 4.6, 0.4),  # the corridor behind the door
    (3.2, 1.3, 4.6, 1.3),
    (4.6, 0.4, 4.6, 1.3),
)
BOX = (
    (1.1, -1.2, 1.7, -1.2),
    (1.7, -1.2, 1.7, -0.8),
    (1.7, -0.8, 1.1, -0.8),
    (1.1, -0.8, 1.1, -1.2),
)
# centre x, centre y, radius
ROUND = ((-1.2, 1.1, 0.25), (0.9, 0.75, 0.06), (0.9, 1.0, 0.06))

_STEPS = 28800  # of the table, in a turn


def distances_m(angle_rad: Floats) -> Floats:
    """Distance from the scanner to what it sees in each direction, counter-clockwise from ahead."""
    steps = np.round(angle_rad * (_STEPS / math.tau)).astype(np.int64) % _STEPS
    return _table()[steps]


@lru_cache(maxsize=1)
def _table() -> Floats:
    angle = np.arange(_STEPS) * (math.tau / _STEPS)
    cosine, sine = np.cos(angle), np.sin(angle)
    nearest = np.full(_STEPS, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for x0, y0, x1, y1 in (*WALLS, *BOX):
            along_x, along_y = x1 - x0, y1 - y0
            determinant = along_x * sine - along_y * cosine
            distance = (along_x * y0 - along_y * x0) / determinant
            share = (cosine * y0 - sine * x0) / determinant
            hit = (distance > 0) & (share >= -1e-9) & (share <= 1 + 1e-9)
            nearest = np.where(hit & (distance < nearest), distance, nearest)
        for x, y, radius in ROUND:
            ahead = x * cosine + y * sine
            aside = x * sine - y * cosine
            distance = ahead - np.sqrt(radius**2 - aside**2)
            hit = (ahead > 0) & (np.abs(aside) <= radius)
            nearest = np.where(hit & (distance < nearest), distance, nearest)
    return nearest
