"""Frame number and send time encoded in the picture as black and white cells.

The cells are the blocks of a JPEG with 4:2:2 colour sampling, 16 × 8 pixels each, in scan order from the
upper left corner: 32 bits of the frame number, 64 bits of the send time (monotonic clock, ns), a CRC-16 of
both. A cell covers its whole block, so the code survives any JPEG quality.
"""

from __future__ import annotations

import binascii
import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CELL_WIDTH = 16
CELL_HEIGHT = 8
CODE_BITS = 112
BLACK, WHITE = 16, 240

_WORDS = struct.Struct(">IQ")
_CHECK = struct.Struct(">H")
_CRC_START = 0xFFFF  # an all-black corner must not pass as frame 0


@dataclass(frozen=True)
class FrameCode:
    """Content of a frame code.

    Attributes:
        number: of the frame; gaps are lost frames.
        sent_ns: time just before the first byte was sent, monotonic clock.
    """

    number: int
    sent_ns: int


def code_bytes(code: FrameCode) -> bytes:
    """The 14 bytes of a code, highest bit first."""
    words = _WORDS.pack(code.number & 0xFFFFFFFF, code.sent_ns)
    return words + _CHECK.pack(binascii.crc_hqx(words, _CRC_START))


def read_code(pixels: npt.NDArray[np.uint8]) -> FrameCode | None:
    """Read the code from a picture of shape (H, W) or (H, W, C); None if there is none."""
    height, width = pixels.shape[:2]
    columns = -(-width // CELL_WIDTH)
    if width < CELL_WIDTH or height < CELL_HEIGHT * -(-CODE_BITS // columns):
        return None
    bits = np.arange(CODE_BITS)
    # the middle of each cell; the last column of a picture may be narrower than a cell
    rows = bits // columns * CELL_HEIGHT + CELL_HEIGHT // 2
    left = bits % columns * CELL_WIDTH
    middle = (left + np.minimum(left + CELL_WIDTH, width) - 1) // 2
    values = pixels[rows, middle].astype(np.int32)
    grey = values if values.ndim == 1 else values.mean(axis=1)
    data = np.packbits(grey > (BLACK + WHITE) // 2).tobytes()
    number, sent_ns = _WORDS.unpack_from(data)
    code = FrameCode(number, sent_ns)
    return code if code_bytes(code) == data else None


def fits(width: int, height: int) -> bool:
    """Return whether a picture of this size has room for the code."""
    columns = -(-width // CELL_WIDTH)
    return width >= CELL_WIDTH and height > CELL_HEIGHT * -(-CODE_BITS // columns)
