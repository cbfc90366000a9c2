"""Frames of one size: the pictures of the scene, encoded once, each with its frame code."""

from __future__ import annotations

from functools import lru_cache

from joshua_emulator.camera.frame_code import (
    CELL_HEIGHT,
    CELL_WIDTH,
    CODE_BITS,
    FrameCode,
    code_bytes,
    fits,
)
from joshua_emulator.camera.jpeg_scan import (
    CELLS_PER_SEGMENT,
    digit_segments,
    encode,
    join_segments,
)
from joshua_emulator.camera.scene import scene

CODE_SEGMENTS = CODE_BITS // CELLS_PER_SEGMENT
MAX_SIDE = 4096


class FrameSizeError(ValueError):
    """A picture size that cannot be served."""


class FrameFactory:
    """Makes JPEG frames of one size; raises FrameSizeError for a size that has no room for the code."""

    def __init__(self, width: int, height: int) -> None:
        if not fits(width, height):
            raise FrameSizeError(
                f"{width} × {height} has no room for the frame code, {CODE_BITS} cells of "
                f"{CELL_WIDTH} × {CELL_HEIGHT} pixels; allowed: 160 × 120 or larger"
            )
        if max(width, height) > MAX_SIDE:
            raise FrameSizeError(f"{width} × {height} is too large; allowed: at most {MAX_SIDE} a side")
        self.width, self.height = width, height
        self._digits = digit_segments()
        encoded = [encode(picture) for picture in scene(width, height)]
        self._heads = [picture.header for picture in encoded]
        self._tails = [picture.tail(CODE_SEGMENTS) for picture in encoded]

    def frame(self, code: FrameCode) -> bytes:
        """Return a JPEG file of the scene with the code."""
        digits = self._digits
        segments = tuple(digits[digit] for byte in code_bytes(code) for digit in (byte >> 4, byte & 15))
        picture = code.number % len(self._heads)
        return b"".join((self._heads[picture], join_segments(segments, 0), self._tails[picture]))


@lru_cache(maxsize=4)
def frame_factory(width: int, height: int) -> FrameFactory:
    """Return the cached factory of a size."""
    return FrameFactory(width, height)
