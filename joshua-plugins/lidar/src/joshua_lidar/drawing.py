"""Top view of a scan: pixels for a file or window, characters for a terminal."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from joshua_lidar.assembly import Beams, Scan
from joshua_lidar.samples import Floats

Pixels = npt.NDArray[np.uint8]

_GROUND = (250, 250, 248)
_SEEN = (226, 238, 250)
_RING = (196, 204, 212)
_ECHO = (20, 60, 130)
_SCANNER = (220, 60, 30)
_DOT = 2  # half size of an echo in pixels; the scanner is three times as large
_MARGIN = 1.08
_LEAST_REACH_M = 0.5
_OUTLIERS = 98  # percentile of the ranges that sets the scale
_MOST_RINGS = 6

# 3 × 5 dot digits, one number per row, for the labels of the rings in metres.
_DIGITS = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 2, 2, 2),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    "m": (0, 6, 7, 7, 5),
}
_DIGIT_SCALE = 2

# Bits of a braille character by row and column of its eight dots (Unicode block 28).
_BRAILLE = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_BRAILLE_START = 0x2800


def top_view(scan: Scan, beams: Beams, size_px: int = 600) -> Pixels:
    """Draw a scan with x (ahead) up and y to the left: free space, range rings in metres, and echoes.

    Returns:
        Shape (size_px, size_px, 3), uint8, RGB.
    """
    ranges = scan.ranges_m.astype(float)
    reach_m = _reach_m(ranges)
    scale = size_px / (2 * reach_m)
    away_px, beam, arrow = _grid(beams, size_px)
    seen_to_px = scale * np.nan_to_num(np.append(ranges, 0.0), nan=0.0, posinf=math.inf, neginf=0.0)
    pixels = np.empty((size_px, size_px, 3), np.uint8)
    pixels[:] = _GROUND
    pixels[away_px < seen_to_px[beam]] = _SEEN
    step_m = max(1, math.ceil(reach_m / _MOST_RINGS))
    for ring_m in range(step_m, math.ceil(reach_m * math.sqrt(2)), step_m):
        pixels[np.abs(away_px - ring_m * scale) < 0.6] = _RING
        _write(pixels, f"{ring_m}m", round(size_px / 2 - ring_m * scale) + 4, size_px // 2 + 4)
    echo = np.isfinite(ranges)
    x, y = _positions(ranges, beams)
    rows, columns = size_px / 2 - x[echo] * scale, size_px / 2 - y[echo] * scale
    for down in range(-_DOT, _DOT + 1):
        for right in range(-_DOT, _DOT + 1):
            if down**2 + right**2 <= _DOT**2 + 1:
                _dot(pixels, rows + down, columns + right, _ECHO)
    pixels[arrow] = _SCANNER
    return pixels


@lru_cache(maxsize=4)
def _grid(beams: Beams, size_px: int) -> tuple[Floats, npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Return for each pixel: distance from the centre, beam (past the last: none), part of the arrow."""
    row, column = np.mgrid[0:size_px, 0:size_px]
    ahead, left = size_px / 2 - row - 0.5, size_px / 2 - column - 0.5
    away = np.hypot(ahead, left)
    beam = np.round((np.arctan2(left, ahead) - beams.angle_min_rad) % math.tau / beams.increment_rad)
    beam[beam >= round(math.tau / beams.increment_rad)] = 0
    arrow = (away < 3 * _DOT) & (np.abs(left) * 2 < 3 * _DOT - ahead)
    return away, np.minimum(beam, beams.count).astype(np.intp), arrow


def terminal_view(scan: Scan, beams: Beams, width: int = 64, height: int = 28) -> str:
    """Draw the echoes of a scan in braille characters, x (ahead) up; ``+`` is the scanner."""
    ranges = scan.ranges_m.astype(float)
    reach_m = _reach_m(ranges)
    dots = np.zeros((4 * height, 2 * width), bool)
    scale = min(4 * height, 2 * width) / (2 * reach_m)
    x, y = _positions(ranges, beams)
    echo = np.isfinite(ranges)
    rows = np.floor(2 * height - x[echo] * scale).astype(int)
    columns = np.floor(width - y[echo] * scale).astype(int)
    inside = (rows >= 0) & (rows < 4 * height) & (columns >= 0) & (columns < 2 * width)
    dots[rows[inside], columns[inside]] = True
    codes = (dots.reshape(height, 4, width, 2) * _BRAILLE[None, :, None, :]).sum(axis=(1, 3))
    lines = [[chr(_BRAILLE_START + code) if code else " " for code in line] for line in codes.tolist()]
    lines[height // 2][width // 2] = "+"
    picture = "\n".join("".join(line).rstrip() for line in lines).strip("\n").split("\n")
    return "\n".join(
        [*picture, f"seen from above, forward is up; {reach_m:.1f} m from the scanner (+) to the edge"]
    )


def _positions(ranges_m: Floats, beams: Beams) -> tuple[Floats, Floats]:
    angle = beams.angle_min_rad + beams.increment_rad * np.arange(beams.count)
    with np.errstate(invalid="ignore"):
        return ranges_m * np.cos(angle), ranges_m * np.sin(angle)


def _reach_m(ranges_m: Floats) -> float:
    echoes = ranges_m[np.isfinite(ranges_m)]
    if not len(echoes):
        return _LEAST_REACH_M
    return max(_LEAST_REACH_M, float(np.percentile(echoes, _OUTLIERS)) * _MARGIN)


def _dot(pixels: Pixels, rows: Floats, columns: Floats, colour: tuple[int, int, int]) -> None:
    row, column = np.floor(rows).astype(int), np.floor(columns).astype(int)
    inside = (row >= 0) & (row < len(pixels)) & (column >= 0) & (column < len(pixels))
    pixels[row[inside], column[inside]] = colour


def _write(pixels: Pixels, text: str, top: int, left: int) -> None:
    for number, letter in enumerate(text):
        for down, bits in enumerate(_DIGITS[letter]):
            for right in range(3):
                if bits >> (2 - right) & 1:
                    row = top + down * _DIGIT_SCALE
                    column = left + (number * 4 + right) * _DIGIT_SCALE
                    if row >= 0 and column >= 0:
                        pixels[row : row + _DIGIT_SCALE, column : column + _DIGIT_SCALE] = _RING
