"""Counts as lines of text: bytes in, counts out, no input or output.

A line is a count, then if the sender likes the time of its clock in microseconds, and for an AS5600 the
content of its status register, with commas between; then if it likes ``*`` and a CRC-8 (polynomial 0x07) of
all before as two hexadecimal digits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

#: A sender that has shown a CRC once must show it on every line.
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
        count: as it stands there.
        time_us: of the sender's clock, None if it does not say.
        status: of an AS5600, None if it does not say.
        end: bytes of the stream up to the end of the line.
    """

    count: int
    time_us: int | None
    status: int | None
    end: int


class LineParser:
    """Finds counts in a stream of bytes.

    What stands before the first end of a line is left out, for its beginning was not seen.

    Args:
        largest: counts beyond it are refused; None for no limit.

    Attributes:
        good, bad: lines so far; last_bad: the last one that could not be read, for messages.
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
        """Take the next bytes; return the lines that are complete with them."""
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
        if len(rest) > _LONGEST_LINE:  # no line is so long: its end will be that of a broken one
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
    """CRC-8 with the polynomial x^8 + x^2 + x + 1, from 0 on, the highest bit first."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ _POLYNOMIAL if crc & 0x80 else crc << 1) & 0xFF
    return crc
