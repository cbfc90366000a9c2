"""One text of a configuration and positions in it."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from joshua.plan import Position


class Source:
    """A named text. Converts offsets to lines and columns, which count characters from 1.

    Attributes:
        name: for diagnostics: the path of the file, or ``--set``.
        text: with line feeds as line ends and without a byte order mark.
        first_line: number of its first line.
    """

    __slots__ = ("_starts", "first_line", "name", "text")

    def __init__(self, name: str, text: str, first_line: int = 1) -> None:
        self.name = name
        self.text = text
        self.first_line = first_line
        self._starts: list[int] | None = None

    def line(self, offset: int) -> int:
        """Return the line number of an offset."""
        return bisect_right(self._line_starts(), offset) + self.first_line - 1

    def column(self, offset: int) -> int:
        """Return the column of an offset."""
        starts = self._line_starts()
        return offset - starts[bisect_right(starts, offset) - 1] + 1

    def indentation(self, offset: int) -> int:
        """Return the column of the first visible character in the line of an offset."""
        start = offset - self.column(offset) + 1
        end = start
        while end < offset and self.text[end].isspace():
            end += 1
        return end - start + 1

    def is_first_on_line(self, offset: int) -> bool:
        """Whether only white space precedes an offset on its line."""
        return self.indentation(offset) == self.column(offset)

    def position(self, start: int, end: int) -> Position:
        """Return the position of a span, cut at the end of its first line."""
        from joshua.plan import Position

        line_end = self.text.find("\n", start)
        if line_end == -1:
            line_end = len(self.text)
        length = max(1, min(end, line_end) - start)
        return Position(file=self.name, line=self.line(start), column=self.column(start), length=length)

    def _line_starts(self) -> list[int]:
        if self._starts is None:
            starts = [0]
            at = self.text.find("\n")
            while at != -1:
                starts.append(at + 1)
                at = self.text.find("\n", at + 1)
            self._starts = starts
        return self._starts


class Span(NamedTuple):
    """A part of a text: offsets of its first character and of the one after its last."""

    source: Source
    start: int
    end: int

    @property
    def text(self) -> str:
        """Its first line."""
        return self.source.text[self.start : self.end].partition("\n")[0]

    @property
    def position(self) -> Position:
        """Its position, cut at the end of its first line."""
        return self.source.position(self.start, self.end)
