"""Parser of counts in lines of text: bytes in, counts out. Does no I/O.

A line holds, separated by commas, a count, optionally the sender's time in microseconds, and for an AS5600
its status register. Optionally ``*`` and a CRC-8 (polynomial 0x07) of everything before follow, as two
hexadecimal digits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

#: A sender that has sent a CRC once must send it on every line.
_LINE = re.compile(
    rb"\s*([+-]?\d{1,20})(?:\s*[,;]\s*(\d{1,20}))?(?:\s*[,;]\s*(\d{1,3}))?\s*(?:\*([0-9A-Fa-f]{2}))?\s*"
)
_LONGEST_LINE = 80
_POLYNOMIAL = 0x07

#: Bits of the AS5600's status register.
MAGNET_FOUND, MAGNET_WEAK, MAGNET_STRONG = 0x20, 0x10, 0x08


@dataclass(frozen=True)
class Count:
    """One line.

    Attributes:
        count: as sent.
        time_us: of the sender's clock, None if not sent.
        status: of an AS5600, None if not sent.
        end: offset of the end of the line in the stream.
    """

    count: int
    time_us: int | None
    status: int | None
    end: int


class LineParser:
    """Finds counts in a stream of bytes.

    Text before the first line end is skipped because its beginning is missing.

    Args:
        largest: largest valid count; None for no limit.

    Attributes:
        good, bad: lines so far; last_bad: the last invalid line, for messages.
    """

    def __init__(self, largest: int | None = None) -> None:
        self.good = self.bad = 0
        self.last_bad = b""
        self._largest = largest
        self._buffer = b""
        self._offset = 0
        self._began = False
        self._needs_crc = False

    def feed(self, data: bytes) -> list[Count]:
        """Add bytes; return the lines that they complete."""
        self._buffer += data
        counts = []
        *lines, rest = self._buffer.split(b"\n")
        for line in lines:
            self._offset += len(line) + 1
            if not self._began:
                self._began = True
                continue
            if not line.strip():
                continue
            count = self._read(line)
            if count is None:
                self.bad += 1
                self.last_bad = line[:_LONGEST_LINE]
            else:
                self.good += 1
                counts.append(count)
        if len(rest) > _LONGEST_LINE:  # no valid line is this long: its end will belong to a broken line
            self._offset += len(rest)
            self.bad += 1
            self.last_bad = rest[:_LONGEST_LINE]
            rest, self._began = b"", False
        self._buffer = rest
        return counts

    def _read(self, line: bytes) -> Count | None:
        match = _LINE.fullmatch(line)
        if match is None:
            return None
        value, time_us, status, crc = match.groups()
        if crc is not None:
            if crc8(line[: line.index(b"*")]) != int(crc, 16):
                return None
            self._needs_crc = True
        elif self._needs_crc:
            return None
        count = int(value)
        if self._largest is not None and not 0 <= count <= self._largest:
            return None
        return Count(
            count,
            None if time_us is None else int(time_us),
            None if status is None else int(status),
            self._offset,
        )


def crc8(data: bytes) -> int:
    """Return the CRC-8 with polynomial x^8 + x^2 + x + 1, initial value 0, most significant bit first."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ _POLYNOMIAL if crc & 0x80 else crc << 1) & 0xFF
    return crc
