"""The test scene: a table from above with blocks on it and a circling ball."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

PICTURES = 24  # one turn of the ball

_TABLE = (176, 148, 112)
_BLOCKS = (
    # left, top, width, height as fractions of the picture; colour
    (0.14, 0.42, 0.12, 0.16, (196, 40, 36)),
    (0.44, 0.62, 0.10, 0.13, (40, 120, 52)),
    (0.70, 0.36, 0.14, 0.19, (36, 72, 180)),
    (0.62, 0.78, 0.09, 0.12, (230, 200, 40)),
)
_BALL = (250, 250, 245)
_GRAIN = 2.5  # standard deviation of the table's grain, which gives frames the size of a real camera's


def scene(width: int, height: int) -> list[npt.NDArray[np.uint8]]:
    """Draw one turn of the scene: arrays of shape (H, W, 3), uint8, RGB; the same ones every time."""
    background = _background(width, height)
    y, x = np.mgrid[0:height, 0:width]
    radius = max(2.0, 0.06 * min(width, height))
    pictures = []
    for index in range(PICTURES):
        angle = math.tau * index / PICTURES
        centre_x = width * (0.5 + 0.3 * math.cos(angle))
        centre_y = height * (0.6 + 0.22 * math.sin(angle))
        picture = background.copy()
        picture[(x - centre_x) ** 2 + (y - centre_y) ** 2 <= radius**2] = _BALL
        pictures.append(picture)
    return pictures


def _background(width: int, height: int) -> npt.NDArray[np.uint8]:
    light = np.linspace(0.75, 1.1, width)[None, :, None] * np.linspace(1.0, 0.85, height)[:, None, None]
    picture = np.array(_TABLE, np.float64)[None, None, :] * light
    for left, top, block_width, block_height, colour in _BLOCKS:
        rows = slice(int(top * height), int((top + block_height) * height))
        columns = slice(int(left * width), int((left + block_width) * width))
        picture[rows, columns] = colour
    picture += np.random.default_rng(1).normal(0.0, _GRAIN, (height, width, 1))
    return np.clip(picture, 0, 255).astype(np.uint8)
