"""Line charts as pictures, with numpy alone: panels of curves over a common time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from joshua.devices.glyphs import HEIGHT, WIDTH, text_dots

Picture = npt.NDArray[np.uint8]
Color = tuple[int, int, int]

WHITE: Color = (255, 255, 255)
INK: Color = (40, 40, 46)
GRID: Color = (226, 228, 232)
BLUE: Color = (31, 98, 190)
ORANGE: Color = (226, 110, 20)
RED: Color = (196, 38, 46)
GREEN: Color = (34, 130, 76)

LETTER = 2  # dots of the font in pixels
LEFT, RIGHT, TOP, BOTTOM = 96, 18, 34, 34  # around the area of the curves
MOST_TICKS = 7


@dataclass(frozen=True)
class Curve:
    """One curve; pieces where ``y`` is not a number are left out."""

    label: str
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    color: Color


@dataclass(frozen=True)
class Panel:
    """Curves over one axis; ``least_span`` keeps noise from filling the panel."""

    title: str
    curves: Sequence[Curve]
    least_span: float = 0.0
    x_label: str = ""
    x_range: tuple[float, float] = field(default=(0.0, 1.0))


def draw_panel(panel: Panel, width: int, height: int) -> Picture:
    """Draws one panel."""
    picture = np.full((height, width, 3), WHITE, np.uint8)
    area = (LEFT, TOP, width - RIGHT, height - BOTTOM)
    low, high = _y_range(panel)
    _draw_grid(picture, area, panel, low, high)
    x = LEFT // 4
    put_text(picture, x, 8, panel.title, INK)
    x += (len(panel.title) + 2) * WIDTH * LETTER
    for curve in panel.curves:
        if curve.label:
            picture[14:18, x : x + 22] = curve.color
            put_text(picture, x + 28, 8, curve.label, INK)
            x += 28 + (len(curve.label) + 1) * WIDTH * LETTER
        _draw_curve(picture, area, curve, panel.x_range, (low, high))
    return picture


def stack(rows: Sequence[Sequence[Picture]]) -> Picture:
    """Puts pictures side by side, and rows of them below each other."""
    return np.vstack([np.hstack(row) for row in rows])


def put_text(picture: Picture, x: int, y: int, text: str, color: Color) -> None:
    """Writes a line of text with its top left corner at a place; what does not fit is cut off."""
    dots = np.kron(text_dots(text), np.ones((LETTER, LETTER), np.bool_))
    dots = dots[: max(0, picture.shape[0] - y), : max(0, picture.shape[1] - x)]
    picture[y : y + dots.shape[0], x : x + dots.shape[1]][dots] = color


def ticks(low: float, high: float, most: int = MOST_TICKS) -> tuple[list[float], int]:
    """Round numbers within a range, and the decimals that they need."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return [low], 1
    step = 10.0 ** math.floor(math.log10(span / most))
    step *= next(factor for factor in (1, 2, 5, 10) if span / (step * factor) <= most)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)], decimals


def _y_range(panel: Panel) -> tuple[float, float]:
    values = np.concatenate([curve.y[np.isfinite(curve.y)] for curve in panel.curves] or [np.zeros(0)])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    span = max(high - low, panel.least_span, 1e-6)
    middle = (low + high) / 2
    return middle - 0.55 * span, middle + 0.55 * span


def _draw_grid(
    picture: Picture, area: tuple[int, int, int, int], panel: Panel, low: float, high: float
) -> None:
    left, top, right, bottom = area
    y_ticks, decimals = ticks(low, high, 5)
    for value in y_ticks:
        y = round(bottom - (value - low) / (high - low) * (bottom - top))
        picture[y, left:right] = GRID
        text = f"{value:.{decimals}f}"
        put_text(
            picture, max(0, left - 8 - len(text) * WIDTH * LETTER), y - HEIGHT * LETTER // 2 + 1, text, INK
        )
    first, last = panel.x_range
    x_ticks, decimals = ticks(first, last)
    for value in x_ticks:
        x = round(left + (value - first) / (last - first) * (right - left)) if last > first else left
        picture[top:bottom, min(x, right - 1)] = GRID
        text = f"{value:.{decimals}f}"
        if panel.x_label:
            put_text(picture, x - len(text) * WIDTH * LETTER // 2, bottom + 8, text, INK)
    if panel.x_label:
        put_text(picture, right - len(panel.x_label) * WIDTH * LETTER, top - 20, panel.x_label, INK)
    picture[bottom, left:right] = INK
    picture[top : bottom + 1, left] = INK


def _draw_curve(
    picture: Picture,
    area: tuple[int, int, int, int],
    curve: Curve,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
) -> None:
    left, top, right, bottom = area
    (first, last), (low, high) = x_range, y_range
    if curve.x.size == 0 or last <= first:
        return
    x = left + (curve.x - first) / (last - first) * (right - 1 - left)
    y = bottom - (curve.y - low) / (high - low) * (bottom - top)
    good = np.isfinite(x) & np.isfinite(y)
    for index in range(x.size - 1):
        if good[index] and good[index + 1]:
            _draw_line(picture, (x[index], y[index]), (x[index + 1], y[index + 1]), curve.color)
    if x.size == 1 and good[0]:
        _draw_line(picture, (x[0] - 2, y[0]), (x[0] + 2, y[0]), curve.color)


def _draw_line(picture: Picture, start: tuple[float, float], end: tuple[float, float], color: Color) -> None:
    """A line two pixels wide, its edges blended with what is there."""
    steps = max(2, math.ceil(2 * max(abs(end[0] - start[0]), abs(end[1] - start[1]))))
    share = np.linspace(0.0, 1.0, steps)
    x = start[0] + share * (end[0] - start[0])
    y = start[1] + share * (end[1] - start[1])
    steep = abs(end[1] - start[1]) > abs(end[0] - start[0])
    along, across = (y, x) if steep else (x, y)
    base = np.floor(across).astype(np.int64)
    for offset in (-1, 0, 1, 2):
        cover = np.clip(1.5 - np.abs(base + offset - across), 0.0, 1.0)
        rows, columns = (along, base + offset) if steep else (base + offset, along)
        _blend(picture, np.rint(rows).astype(np.int64), np.rint(columns).astype(np.int64), cover, color)


def _blend(
    picture: Picture,
    rows: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int64],
    cover: npt.NDArray[np.float64],
    color: Color,
) -> None:
    inside = (rows >= 0) & (rows < picture.shape[0]) & (columns >= 0) & (columns < picture.shape[1])
    rows, columns, cover = rows[inside], columns[inside], cover[inside, None]
    wanted = np.rint(cover * np.array(color) + (1 - cover) * 255).astype(np.uint8)
    picture[rows, columns] = np.minimum(picture[rows, columns], wanted)
