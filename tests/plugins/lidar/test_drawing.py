"""Pictures of a scan: a wall stands where it was measured."""

from __future__ import annotations

import math

import numpy as np
from joshua_lidar.assembly import Beams, Scan
from joshua_lidar.drawing import terminal_view, top_view

BEAMS = Beams.of(-math.pi, math.pi - 1e-4, 360)
ANGLE = BEAMS.angle_min_rad + BEAMS.increment_rad * np.arange(360)


def scan(ranges: np.ndarray) -> Scan:
    return Scan(0, 0.0, 0.1, ranges.astype(np.float32), np.zeros(0, np.float32), 360)


def dark(pixels: np.ndarray) -> np.ndarray:
    return pixels[..., 0].astype(int) + pixels[..., 1] < 100


def test_an_object_to_the_left_ahead_is_drawn_there() -> None:
    ranges = np.full(360, np.nan)
    ranges[(ANGLE > 0.7) & (ANGLE < 0.9)] = 2.0
    rows, columns = np.nonzero(dark(top_view(scan(ranges), BEAMS, 400)))
    assert len(rows)
    assert rows.max() < 200  # ahead is up
    assert columns.max() < 200  # left is left
    lines = terminal_view(scan(ranges), BEAMS).split("\n")
    above = [line for line in lines[:-1] if any(ord(letter) > 0x2800 for letter in line)]
    scanner = next(line for line in lines if "+" in line)
    assert above
    assert all(len(line) < scanner.index("+") for line in above if line is not scanner)
    assert "2.2 m from the scanner (+) to the edge" in lines[-1]


def test_values_that_are_no_distance_are_not_drawn() -> None:
    ranges = np.full(360, np.nan)
    ranges[:100], ranges[100:200] = np.inf, -np.inf
    assert not dark(top_view(scan(ranges), BEAMS, 200)).any()
    assert "0.5 m from the scanner" in terminal_view(scan(ranges), BEAMS)


def test_what_was_seen_through_is_tinted_as_far_as_the_echo() -> None:
    pixels = top_view(scan(np.full(360, 2.0)), BEAMS, 400)
    inside, outside = pixels[200, 120], pixels[5, 5]
    assert tuple(inside) != tuple(outside)
