"""Charts: round ticks, curves where they belong, text that can be read."""

from __future__ import annotations

import numpy as np
import pytest
from joshua.devices.chart import (
    BLUE,
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    Curve,
    Panel,
    draw_panel,
    put_text,
    stack,
    ticks,
)
from joshua.devices.glyphs import text_dots

WIDTH, HEIGHT = 400, 200


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, ([0, 2, 4, 6, 8, 10], 0)),
        (-0.55, 0.55, ([-0.4, -0.2, 0, 0.2, 0.4], 1)),
        (26.9, 31.1, ([27, 28, 29, 30, 31], 0)),
        (0.0, 0.012, ([0, 0.002, 0.004, 0.006, 0.008, 0.01, 0.012], 3)),
        (3.0, 3.0, ([3.0], 1)),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, expected: tuple[list[float], int]) -> None:
    found, decimals = ticks(low, high)
    assert (found, decimals) == (pytest.approx(expected[0]), expected[1])


def blue(picture: np.ndarray) -> np.ndarray:
    return np.argwhere((picture == BLUE).all(axis=2))


def draw(y: list[float]) -> np.ndarray:
    curve = Curve("", np.linspace(0, 1, len(y)), np.array(y), BLUE)
    return draw_panel(Panel("t", (curve,), 1.0, "time, s"), WIDTH, HEIGHT)


def test_a_rising_curve_rises_from_left_to_right_inside_its_area() -> None:
    points = blue(draw([0.0, 1.0]))
    assert points[:, 1].min() >= LEFT - 1
    assert points[:, 1].max() <= WIDTH - RIGHT
    assert points[:, 0].min() >= TOP
    assert points[:, 0].max() <= HEIGHT - BOTTOM
    left, right = points[points[:, 1].argmin()], points[points[:, 1].argmax()]
    assert left[0] > right[0] + 100


def test_values_that_are_no_numbers_leave_a_gap() -> None:
    columns = set(blue(draw([0.0, 0.1, np.nan, 0.9, 1.0]))[:, 1].tolist())
    middle = LEFT + (WIDTH - RIGHT - LEFT) // 2
    assert not columns & set(range(middle - 20, middle + 20))
    assert blue(draw([np.nan, np.nan])).size == 0
    assert blue(draw([])).size == 0
    assert blue(draw([0.5])).size > 0


def test_text_is_drawn_by_its_dots() -> None:
    letter = ["".join("#" if dot else "." for dot in row) for row in text_dots("L")]
    assert letter == ["#....."] * 6 + ["#####.", "......"]
    assert (text_dots("é") == text_dots("?")).all()
    assert text_dots("°").any()
    assert text_dots("").shape == (8, 0)
    picture = np.full((20, 20, 3), 255, np.uint8)
    put_text(picture, 10, 10, "cut off at the edge", (0, 0, 0))
    assert (picture[:10] == 255).all()
    assert (picture == 0).any()


def test_pictures_are_stacked() -> None:
    picture = draw([0.0, 1.0])
    assert stack([[picture, picture], [picture, picture]]).shape == (2 * HEIGHT, 2 * WIDTH, 3)
