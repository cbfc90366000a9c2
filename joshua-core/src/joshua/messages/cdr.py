"""The parts of CDR (XCDR1, little endian) that the fast paths share.

Source: OMG DDSI-RTPS 2.5, section 10, and the encoding that ROS 2 middlewares use.
"""

from __future__ import annotations

import struct
import sys

from joshua.messages.typestore import MessageError

HEADER_LE = b"\x00\x01\x00\x00"
NATIVE_LE = sys.byteorder == "little"
STAMP = struct.Struct("<4siI")  # encapsulation header, sec, nanosec

_U32 = struct.Struct("<I")
u32 = _U32.pack
u32_at = _U32.unpack_from


def pad(position: int, alignment: int) -> bytes:
    """Zero bytes that align a position."""
    return b"\x00" * (-position % alignment)


def put_string(parts: list[bytes], position: int, text: str) -> int:
    """Appends an aligned string. Returns the position after it."""
    try:
        raw = text.encode()
    except UnicodeEncodeError as error:
        raise MessageError(f"the text {text!r} cannot be written as UTF-8: {error.reason}") from error
    gap = pad(position, 4)
    parts += (gap, u32(len(raw) + 1), raw, b"\x00")
    return position + len(gap) + 5 + len(raw)


def get_string(view: memoryview, position: int) -> tuple[str, int]:
    """Reads an aligned string; returns it with the position after it.

    Raises:
        ValueError: the length does not fit the payload, or the text is not UTF-8.
        struct.error: the payload ends before the length.
    """
    position += -position % 4
    length = u32_at(view, position)[0]
    end = position + 4 + length
    if not length or end > len(view):
        raise ValueError(f"the string at byte {position} has the length {length}")
    if view[end - 1]:
        raise ValueError(f"the string at byte {position} has no terminator")
    return str(view[position + 4 : end - 1], "utf-8"), end


def check_end(position: int, length: int) -> None:
    """Reject payloads with more than the three padding bytes that CDR allows after the last field.

    Raises:
        ValueError: more bytes follow.
    """
    if position + 3 < length:
        raise ValueError(f"{length - position} bytes follow the last field")
