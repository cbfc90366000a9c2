"""A moving test pattern that carries its frame number where a program can read it.

The upper left corner shows the number as black and white squares, sixteen in a row: two rows for its 32 bits,
highest first, and one row for their CRC-16, which distinguishes a picture without a number from one with a
number, even after lossy compression.
"""

from __future__ import annotations

import binascii

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]

_COLUMNS, _ROWS = 16, 3
_MODULUS = 1 << 32


class MovingPattern:
    """Draws the frames of one picture size.

    Args:
        width: in pixels, at least 16.
        height: in pixels, at least 16.
    """

    def __init__(self, width: int, height: int) -> None:
        self._width = width
        x = np.arange(2 * width)
        y = np.arange(height)[:, None]
        # a diagonal gradient over two widths, so that each frame is a window that moves along x
        self._wide = np.empty((height, 2 * width, 3), np.uint8)
        self._wide[..., 0] = (x % width) * 256 // width
        self._wide[..., 1] = (y * 256 // height).repeat(2 * width, axis=1)
        self._wide[..., 2] = ((x % width) + y) * 256 // (width + height)
        self._square = _square_size(width, height)

    def draw(self, number: int) -> Pixels:
        """Draw a frame: shape (H, W, 3), uint8, RGB; a new array each time."""
        offset = (number * 4) % self._width
        frame = np.ascontiguousarray(self._wide[:, offset : offset + self._width])
        squares = np.where(_bits(number), 255, 0).astype(np.uint8)
        cells = squares.repeat(self._square, axis=0).repeat(self._square, axis=1)
        frame[: cells.shape[0], : cells.shape[1]] = cells[..., None]
        return frame


def frame_number(pixels: Pixels) -> int | None:
    """Read the frame number from a picture of shape (H, W) or (H, W, C); None if there is none."""
    height, width = pixels.shape[:2]
    if width < _COLUMNS or height < _COLUMNS:
        return None
    size = _square_size(width, height)
    corner = pixels[: _ROWS * size, : _COLUMNS * size]
    grey = corner if corner.ndim == 2 else corner.mean(axis=2)
    cells = grey.reshape(_ROWS, size, _COLUMNS, size).mean(axis=(1, 3))
    words = [int("".join("1" if cell > 127 else "0" for cell in row), 2) for row in cells]
    number = words[0] << 16 | words[1]
    return number if _checksum(number) == words[2] else None


def _square_size(width: int, height: int) -> int:
    return max(1, min(width // _COLUMNS, height // (2 * _ROWS), 16))


def _checksum(number: int) -> int:
    # an initial value other than 0 keeps an all-black corner from passing as frame 0
    return binascii.crc_hqx(number.to_bytes(4, "big"), 0xFFFF)


def _bits(number: int) -> npt.NDArray[np.bool_]:
    number %= _MODULUS
    words = (number >> 16, number & 0xFFFF, _checksum(number))
    return np.array([[bool(word >> (15 - column) & 1) for column in range(_COLUMNS)] for word in words])
