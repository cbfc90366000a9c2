"""Read the header and small tables of a weights file, without torch and without numpy."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.tools import parse_json

#: Larger headers are refused by the library, too.
_LARGEST_HEADER_B = 100_000_000

_FORMATS = {"F64": "d", "F32": "f", "F16": "e", "I64": "q", "I32": "i", "I16": "h", "I8": "b", "U8": "B"}


class TornFileError(Exception):
    """A file is not a safetensors file, or a part of it is missing. The message says which."""


@dataclass(frozen=True)
class Entry:
    """One tensor of a file: its type such as ``F32``, its shape, and the position of its bytes."""

    dtype: str
    shape: tuple[int, ...]
    begin: int
    end: int


def entries(path: Path) -> dict[str, Entry]:
    """Return the tensors of a file by name, after checking that the file is complete.

    Raises:
        TornFileError: it is not complete.
        OSError: it cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        length = int.from_bytes(file.read(8), "little")
        if size < 8 or not 2 <= length <= min(size - 8, _LARGEST_HEADER_B):
            raise TornFileError(f"{path} is not a safetensors file: its header is missing or cut off")
        try:
            header = parse_json(file.read(length))
            found = {
                name: _entry(values, 8 + length) for name, values in header.items() if name != "__metadata__"
            }
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise TornFileError(f"{path} is not a safetensors file: its header cannot be read") from error
    needed = max((entry.end for entry in found.values()), default=8 + length)
    if needed != size:
        raise TornFileError(
            f"{path} has {size} bytes, but its header describes {needed}: the file was not copied or "
            "downloaded to its end"
        )
    return found


def table(path: Path) -> dict[str, tuple[float, ...]]:
    """Return all numbers of a small file by name, flattened. Raises TornFileError, OSError."""
    return {name: _numbers(path, entry) for name, entry in entries(path).items() if entry.dtype in _FORMATS}


def _entry(values: Mapping[str, Any], offset: int) -> Entry:
    begin, end = map(int, values["data_offsets"])
    if not 0 <= begin <= end:
        raise ValueError("offsets in the wrong order")
    return Entry(str(values["dtype"]), tuple(map(int, values["shape"])), offset + begin, offset + end)


def _numbers(path: Path, entry: Entry) -> tuple[float, ...]:
    with path.open("rb") as file:
        file.seek(entry.begin)
        content = file.read(entry.end - entry.begin)
    letter = _FORMATS[entry.dtype]
    count = len(content) // struct.calcsize(letter)
    return tuple(map(float, struct.unpack(f"<{count}{letter}", content)))
