"""A source line with a caret under the span that a finding is about."""

from __future__ import annotations

from joshua.config.diagnostics.cells import cell
from joshua.plan import Position

_ELISION = "..."


class Lines:
    """The lines of the sources, split once for each file."""

    def __init__(self, sources: dict[str, str]) -> None:
        self._sources = sources
        self._lines: dict[str, list[str]] = {}

    def get(self, position: Position) -> str | None:
        """Returns the line of a position, or None when the text is not known."""
        if position.file not in self._sources:
            return None
        if position.file not in self._lines:
            self._lines[position.file] = self._sources[position.file].split("\n")
        lines = self._lines[position.file]
        if not 1 <= position.line <= len(lines):
            return None
        return lines[position.line - 1].rstrip("\r")


def snippet(line: str, column: int, length: int, columns: int) -> tuple[str, str]:
    """Returns the visible part of a line and the carets below it.

    Args:
        line: source line without its end.
        column: first character of the span, from 1; length: characters of the span.
        columns: terminal columns that may be used.
    """
    first = min(max(column - 1, 0), len(line))
    last = min(first + max(length, 1), len(line) + 1)  # a caret may stand one past the end
    if len(line) <= columns and line.isascii() and line.isprintable():
        return line.rstrip(), " " * first + "^" * (last - first)
    # Characters farther away never fit on the screen, so they are not even looked at.
    low, high = max(0, first - 2 * columns), min(len(line), first + 2 * columns)
    cells = [cell(character) for character in line[low:high]]
    start, end, more_left, more_right = _window(cells, first - low, last - low, columns)
    more_left = more_left or low > 0
    more_right = more_right or high < len(line)
    text = "".join(shown for shown, _ in cells[start:end]).rstrip()
    before = sum(width for _, width in cells[start : first - low])
    under = sum(width for _, width in cells[max(start, first - low) : min(end, last - low)])
    left = _ELISION if more_left else ""
    right = _ELISION if more_right else ""
    return f"{left}{text}{right}", " " * (len(left) + before) + "^" * max(under, 1)


def _window(cells: list[tuple[str, int]], first: int, last: int, columns: int) -> tuple[int, int, bool, bool]:
    """Chooses the cells that are shown: all, or a part around the span with room for the elisions."""
    if sum(width for _, width in cells) <= columns:
        return 0, len(cells), False, False
    room = columns - 2 * len(_ELISION)
    start = min(first, len(cells))
    # One third of the room shows what stands before the span, the rest the span and what follows.
    context = room // 3
    while start > 0 and context > 0:
        context -= cells[start - 1][1]
        start -= 1
    end, used = start, 0
    while end < len(cells) and used + cells[end][1] <= room:
        used += cells[end][1]
        end += 1
    while start > 0 and used + cells[start - 1][1] <= room:
        start -= 1
        used += cells[start][1]
    return start, end, start > 0, end < len(cells)
