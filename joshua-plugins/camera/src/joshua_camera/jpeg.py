"""Check of a JPEG picture without decoding it: completeness and size (ITU-T T.81, annex B)."""

from __future__ import annotations

import re
from dataclasses import dataclass

_START = b"\xff\xd8"
_START_OF_SCAN = 0xDA
# baseline, extended and progressive frames; 0xC4, 0xC8 and 0xCC are other segments
_FRAME_HEADERS = frozenset({0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF})
_PROGRESSIVE = frozenset({0xC2, 0xC6, 0xCA, 0xCE})
_END_OF_IMAGE = 0xD9
# In the scan, 0xFF is followed by 0 or a restart marker; anything else ends the scan.
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")


@dataclass(frozen=True)
class JpegFacts:
    """Size of a JPEG picture in pixels, and its length in bytes."""

    width: int
    height: int
    length: int


def inspect_jpeg(data: bytes | memoryview) -> JpegFacts | None:
    """Return size and length of a picture; None if it is truncated, has no size or has stray markers.

    Bytes after the end of the picture are padding by the device and do not count.
    """
    view = bytes(data)
    if not view.startswith(_START):
        return None
    size: tuple[int, int] | None = None
    progressive = False
    at = 2
    while at + 4 <= len(view):
        if view[at] != 0xFF:
            return None
        marker = view[at + 1]
        if marker == 0xFF:  # a fill byte
            at += 1
            continue
        length = int.from_bytes(view[at + 2 : at + 4], "big")
        if length < 2 or at + 2 + length > len(view):
            return None
        if marker in _FRAME_HEADERS and length >= 8:
            height, width = (int.from_bytes(view[at + place : at + place + 2], "big") for place in (5, 7))
            size = (width, height)
            progressive = marker in _PROGRESSIVE
        at += 2 + length
        if marker == _START_OF_SCAN:
            end = _end_of_picture(view, at, progressive)
            return JpegFacts(*size, end) if size is not None and all(size) and end else None
    return None


def _end_of_picture(view: bytes, at: int, progressive: bool) -> int:
    """Return where the picture ends, 0 if it is truncated. A progressive picture has several scans."""
    while (match := _AFTER_SCAN.search(view, at)) is not None:
        if view[match.end() - 1] == _END_OF_IMAGE:
            return match.end()
        if not progressive:
            return 0
        at = match.end()
    return 0
