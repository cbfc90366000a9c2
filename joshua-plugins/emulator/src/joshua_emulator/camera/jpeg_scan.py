"""JPEG pictures with an entropy-coded scan assembled from segments (ITU-T T.81, F.1.1.5 and E.1.4).

With a restart interval, the scan is a sequence of byte-aligned segments that are decodable on their own. The
cells of the frame code are therefore encoded once in all variants, and a frame costs only a join of byte
strings.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from joshua_emulator.camera.frame_code import BLACK, CELL_HEIGHT, CELL_WIDTH, WHITE

CELLS_PER_SEGMENT = 4  # one hexadecimal digit of the code

_QUALITY = 85
_START_OF_SCAN = b"\xff\xda"
_END = b"\xff\xd9"
_RESTART = re.compile(rb"\xff[\xd0-\xd7]")


@dataclass(frozen=True)
class EncodedPicture:
    """A picture as the header of its file and the segments of its scan."""

    header: bytes
    segments: tuple[bytes, ...]

    def tail(self, first: int) -> bytes:
        """The scan from a segment on, markers included, to the end of the file."""
        return join_segments(self.segments[first:], first) + _END


def encode_file(pixels: npt.NDArray[np.uint8]) -> bytes:
    """A JPEG file of a picture of shape (H, W, 3), uint8, RGB, with 4:2:2 sampling as UVC cameras have it."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(
        file, "JPEG", quality=_QUALITY, subsampling="4:2:2", restart_marker_blocks=CELLS_PER_SEGMENT
    )
    return file.getvalue()


def encode(pixels: npt.NDArray[np.uint8]) -> EncodedPicture:
    """Encode a picture and split its scan into segments."""
    data = encode_file(pixels)
    start = data.index(_START_OF_SCAN)
    start += 2 + int.from_bytes(data[start + 2 : start + 4], "big")
    return EncodedPicture(data[:start], tuple(_RESTART.split(data[start : -len(_END)])))


def digit_segments() -> tuple[bytes, ...]:
    """The segments that show the digits 0 to 15 as four cells, the highest bit first."""
    return tuple(encode(_digit(value)).segments[0] for value in range(16))


def join_segments(segments: tuple[bytes, ...], first: int) -> bytes:
    """Join segments, each except the picture's first after its restart marker.

    Args:
        first: index of the first of them in its picture, which numbers the markers.
    """
    return b"".join(
        _marker(index) + segment if index else segment for index, segment in enumerate(segments, first)
    )


def _marker(index: int) -> bytes:
    return bytes((0xFF, 0xD0 + (index - 1) % 8))


def _digit(value: int) -> npt.NDArray[np.uint8]:
    bits = value >> np.arange(CELLS_PER_SEGMENT)[::-1] & 1
    row = np.repeat(np.where(bits, WHITE, BLACK).astype(np.uint8), CELL_WIDTH)
    return np.repeat(np.tile(row, (CELL_HEIGHT, 1))[:, :, None], 3, axis=2)
