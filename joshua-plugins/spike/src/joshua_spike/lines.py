"""Lines between host and hub program: kind, sequence number, words and CRC."""

from __future__ import annotations

import binascii
import re
from collections.abc import Iterable
from dataclasses import dataclass

LONGEST_LINE = 400
_LINE = re.compile(rb"([A-Z?])([0-9a-f]{2})((?:,[^,*]*)*)\*([0-9a-f]{4})")


@dataclass(frozen=True)
class Line:
    """One line.

    Attributes:
        kind: one letter; sequence: 0 to 255.
        words: arguments.
    """

    kind: str
    sequence: int
    words: tuple[str, ...] = ()

    def encode(self) -> bytes:
        """Return the line as sent, including its end."""
        body = ",".join((f"{self.kind}{self.sequence:02x}", *self.words)).encode("ascii")
        return b"%s*%04x\n" % (body, binascii.crc_hqx(body, 0xFFFF))


@dataclass(frozen=True)
class HubState:
    """One state line of the hub, in the hub's units.

    Attributes:
        sequence: of the line that it replies to.
        energised, tripped, holding: of the motors; tripped means that the dead man's switch acted.
        refused: lines that the hub rejected, modulo 256.
        battery_mv: voltage.
        angles_deg, speeds_deg_s, loads_mnm: one value for each motor.
    """

    sequence: int
    energised: bool
    tripped: bool
    holding: bool
    refused: int
    battery_mv: int
    angles_deg: tuple[int, ...]
    speeds_deg_s: tuple[int, ...]
    loads_mnm: tuple[int, ...]

    @classmethod
    def of(cls, line: Line) -> HubState:
        """Read a line of kind S. Raises ValueError."""
        numbers = [int(word) for word in line.words]
        if len(numbers) < 3 or len(numbers) % 3:
            raise ValueError(f"a state has flags, errors, voltage and three numbers a motor: {line.words}")
        flags, refused, battery_mv, *motors = numbers
        return cls(
            line.sequence,
            bool(flags & 1),
            bool(flags & 2),
            bool(flags & 4),
            refused,
            battery_mv,
            tuple(motors[0::3]),
            tuple(motors[1::3]),
            tuple(motors[2::3]),
        )


class LineReader:
    """Assembles lines from the hub's output, in chunks of any size.

    Attributes:
        corrupt: damaged lines of the hub program.
    """

    def __init__(self) -> None:
        self._buffer = b""
        self.corrupt = 0

    def feed(self, data: bytes) -> Iterable[Line | str]:
        """Add output; return complete lines; those of other programs or errors as text."""
        *whole, self._buffer = (self._buffer + data).split(b"\n")
        self._buffer = self._buffer[-LONGEST_LINE:]
        for raw in whole:
            text = raw.rstrip(b"\r")
            match = _LINE.fullmatch(text)
            if match is None or int(match[4], 16) != binascii.crc_hqx(text[:-5], 0xFFFF):
                if _looks_like_ours(text):
                    self.corrupt += 1
                elif text.strip():
                    yield text.decode(errors="replace")
                continue
            words = tuple(match[3].decode("ascii", errors="replace").split(",")[1:])
            yield Line(match[1].decode(), int(match[2], 16), words)

    def clear(self) -> None:
        """Forget an unfinished line."""
        self._buffer = b""


def _looks_like_ours(text: bytes) -> bool:
    return b"*" in text[-6:] or (text[:1] in (b"S", b"R", b"M") and b"," in text[:5])
