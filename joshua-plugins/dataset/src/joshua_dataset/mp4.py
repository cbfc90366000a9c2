"""The boxes of an MP4 file that was written in fragments: which of them a kill has left whole.

While it is written, a file has a header, then fragments, each a ``moof`` box and its ``mdat`` box; the first
one is a ``moov`` box and its ``mdat`` box. When it is complete, one ``mdat`` box covers all of them, and one
``moov`` box at the end describes the pictures. Source: ISO/IEC 14496-12, and FFmpeg's ``hybrid_fragmented``.
"""

from __future__ import annotations

import io
import os
import struct
from dataclasses import dataclass
from pathlib import Path

_BOX = struct.Struct(">I4s")
_LARGE = struct.Struct(">Q")

#: Boxes that a file of fragments consists of.
_KNOWN = (b"ftyp", b"free", b"moov", b"moof", b"mdat", b"styp", b"sidx", b"mfra", b"wide", b"skip")


@dataclass(frozen=True)
class _Box:
    """One box of a file.

    Attributes:
        begin, end: offsets; the end may lie beyond that of a truncated file.
        content: offset after the header.
    """

    kind: bytes
    begin: int
    content: int
    end: int


@dataclass(frozen=True)
class Fragments:
    """What is whole of a video.

    Attributes:
        is_complete: the file is an ordinary video with an index.
        end: offset at which the last whole fragment ends; 0 without one.
        patch: bytes that make the fragments visible again, by their offset.
        is_torn: only the end is missing, as after a kill; not, if something else follows the last fragment.
    """

    is_complete: bool
    end: int
    patch: tuple[int, bytes]
    is_torn: bool


def fragments(path: Path) -> Fragments:
    """Find the whole fragments of a file. Raises OSError."""
    size = path.stat().st_size
    with path.open("rb") as file:
        boxes = _boxes(file, 0, size)
        kinds = [box.kind for box in boxes]
        is_whole = bool(boxes) and boxes[-1].end == size
        if is_whole and b"moof" not in kinds and kinds.count(b"moov") == 1 and kinds[-1] == b"moov":
            return Fragments(True, size, (0, b""), False)
        patch = (0, b"")
        first = kinds.index(b"mdat") if b"mdat" in kinds else -1
        if first >= 0 and b"moov" not in kinds[:first]:  # its header is that of a complete file
            hidden = boxes[first]
            inner = _boxes(file, hidden.content, size)
            if inner and inner[0].kind == b"ftyp":
                boxes = inner
                patch = (hidden.begin, _free(hidden, inner[0].end))
    end, is_open = 0, False
    last = 0
    for box in boxes:
        if box.kind not in _KNOWN or box.end > size:
            break
        last = box.end
        if box.kind in (b"moof", b"moov"):
            is_open = True
        elif box.kind == b"mdat" and is_open:
            end, is_open = box.end, False
    return Fragments(False, end, patch, _is_torn(boxes, last, size))


def is_cut(path: Path) -> bool:
    """Return whether a file ends within one of its boxes. Raises OSError."""
    size = path.stat().st_size
    with path.open("rb") as file:
        boxes = _boxes(file, 0, size)
    return bool(boxes) and boxes[-1].end > size


def opened(path: Path, found: Fragments) -> io.RawIOBase:
    """Open the whole fragments of a file as a file that ends with the last one. Raises OSError."""
    return _Prefix(path, found)


def _free(hidden: _Box, end: int) -> bytes:
    """Return the header that FFmpeg had written in the place of that of a box which covers everything."""
    header = _BOX.pack(end - (hidden.content - 8), b"free")
    if hidden.content - hidden.begin == 16:
        return _BOX.pack(8, b"free") + header
    return header


def _boxes(file: io.BufferedReader, begin: int, size: int) -> list[_Box]:
    """Return the boxes up to the first one that is not whole, included, or not a box at all."""
    found = []
    while begin + 8 <= size:
        file.seek(begin)
        length, kind = _BOX.unpack(file.read(8))
        content = begin + 8
        if length == 1:
            large = file.read(8)
            if len(large) < 8:
                break
            (length,) = _LARGE.unpack(large)
            content += 8
        if length < content - begin:
            break
        found.append(_Box(kind, begin, content, begin + length))
        begin += length
    return found


def _is_torn(boxes: list[_Box], last: int, size: int) -> bool:
    """Return whether what follows the last whole box is the begin of one more."""
    if last == size or size - last < 8:
        return True
    return any(box.begin == last and box.kind in _KNOWN and box.end > size for box in boxes)


class _Prefix(io.RawIOBase):
    """The begin of a file, with a few other bytes."""

    def __init__(self, path: Path, found: Fragments) -> None:
        self._file = path.open("rb")
        self._found = found
        self._position = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        begin, end = self._position, self._found.end
        wanted = max(0, end - begin) if size < 0 else max(0, min(size, end - begin))
        self._file.seek(begin)
        data = bytearray(self._file.read(wanted))
        offset, patch = self._found.patch
        for number, value in enumerate(patch):
            place = offset + number - begin
            if 0 <= place < len(data):
                data[place] = value
        self._position = begin + len(data)
        return bytes(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._found.end}[whence]
        self._position = max(0, base + offset)
        return self._position

    def tell(self) -> int:
        return self._position

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()
