"""Renders findings: text for people, with the source line and a caret, and JSON for editors."""

from __future__ import annotations

import os
import textwrap
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TextIO

from joshua.plan import Diagnostic, Position, Severity
from joshua.plan.diagnostic import masked

TAB_WIDTH = 4
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_CONTROL_PICTURES = 0x2400
_SHOWN_ALLOWED = 8
_SHOWN_RELATED = 5
_COLORS = {Severity.ERROR: "31", Severity.WARNING: "33", Severity.NOTE: "36"}
_WEIGHT = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.NOTE: 2}
_ELISION = "..."
_LABEL_WIDTH = 9
_COLUMNS, _NARROWEST, _WIDEST = 80, 40, 120


def wants_color(stream: TextIO, environment: Mapping[str, str] | None = None) -> bool:
    """Whether to colour the output to a stream: a terminal, NO_COLOR unset or empty, TERM not ``dumb``."""
    values = os.environ if environment is None else environment
    return stream.isatty() and not values.get("NO_COLOR") and values.get("TERM") != "dumb"


def columns_of(stream: TextIO) -> int:
    """Width of lines for a stream: that of its terminal, within limits; 80 for others."""
    if not stream.isatty():
        return _COLUMNS
    try:
        found = os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):
        return _COLUMNS
    return min(max(found, _NARROWEST), _WIDEST) if found else _COLUMNS


def render_text(
    diagnostics: Iterable[Diagnostic],
    sources: Mapping[str, str],
    color: bool = False,
    columns: int = _COLUMNS,
) -> str:
    """Render findings for people, sorted by file and position, with a summary line at the end.

    Args:
        diagnostics: findings in any order.
        sources: file name to text, root file first.
        color: whether ANSI colours are used; see ``wants_color``.
        columns: terminal width for the lines.

    Returns:
        Text that ends with a line break; "" if there are no findings.
    """
    ordered = in_order(diagnostics, sources)
    if not ordered:
        return ""
    lines = {name: text.split("\n") for name, text in sources.items()}
    paint = _painted if color else _plain
    blocks = [_finding(item, lines, paint, columns) for item in ordered]
    return "\n\n".join([*blocks, summary(ordered, sources)]) + "\n"


def summary(diagnostics: Sequence[Diagnostic], sources: Mapping[str, str]) -> str:
    """Count findings, as in ``3 errors, 1 warning in robot.pbtxt``."""
    counts = Counter(item.severity for item in diagnostics)
    parts = [
        f"{counts[severity]} {severity.value}{'' if counts[severity] == 1 else 's'}"
        for severity in Severity
        if counts[severity]
    ]
    files = dict.fromkeys(item.position.file for item in diagnostics if item.position is not None)
    if len(files) > 2:
        place = f" in {len(files)} files"
    elif files:
        place = " in " + " and ".join(clean(name) for name in files)
    else:
        place = "".join(f" in {clean(name)}" for name in list(sources)[:1])
    return (", ".join(parts) or "no problems") + place


def in_order(diagnostics: Iterable[Diagnostic], sources: Mapping[str, str]) -> list[Diagnostic]:
    """Sort findings: those without a position first, then by order in ``sources``, line and column."""
    rank = {name: index for index, name in enumerate(sources)}

    def key(item: Diagnostic) -> tuple[int, str, int, int, int]:
        if item.position is None:
            return (-1, "", 0, 0, _WEIGHT[item.severity])
        place = item.position
        return (rank.get(place.file, len(rank)), place.file, place.line, place.column, _WEIGHT[item.severity])

    return sorted(diagnostics, key=key)


def _painted(text: str, style: str) -> str:
    return f"\x1b[{style}m{text}\x1b[0m"


def _plain(text: str, style: str) -> str:
    del style
    return text


def _finding(
    item: Diagnostic, lines: Mapping[str, list[str]], paint: Callable[[str, str], str], columns: int
) -> str:
    color = _COLORS[item.severity]
    parts = _headline(item, paint, color, columns)
    if item.field_path:
        parts.append("  field:   " + shorten(item.field_path, 4 * columns))
    parts += _source(item, lines, paint, color, columns)
    if item.found:
        parts.append("  found:   " + shorten(item.found, columns - 2 - _LABEL_WIDTH))
    if item.allowed:
        parts += _labelled("allowed:", _allowed(item.allowed), columns)
    if item.remedy:
        parts += _labelled("do:", item.remedy, columns)
    for other in item.related[:_SHOWN_RELATED]:
        parts += _labelled("see:", f"{other.position}: {other.label}", columns)
    if len(item.related) > _SHOWN_RELATED:
        parts += _labelled("see:", f"and {len(item.related) - _SHOWN_RELATED} more places", columns)
    return "\n".join(parts)


def _headline(item: Diagnostic, paint: Callable[[str, str], str], color: str, columns: int) -> list[str]:
    """Write position, severity and message. The position comes first, so terminals and editors link it."""
    place = f"{clean(str(item.position))}: " if item.position is not None else ""
    label = f"{item.severity.value}: "
    text = f"{clean(item.message)} [{item.code}]"
    wrapped = textwrap.wrap(
        place.replace(" ", "\0") + label.replace(" ", "\0") + text,
        columns,
        subsequent_indent="  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    first = wrapped[0].replace("\0", " ")[len(place) + len(label) :]
    head = paint(place, "1") + paint(label, f"1;{color}") + first
    return [head.rstrip(), *wrapped[1:]]


def _source(
    item: Diagnostic,
    lines: Mapping[str, list[str]],
    paint: Callable[[str, str], str],
    color: str,
    columns: int,
) -> list[str]:
    if item.position is None:
        return []
    known, number = lines.get(item.position.file, []), item.position.line
    line = masked(known[number - 1]).rstrip("\r") if 1 <= number <= len(known) else ""
    if not line.strip():
        return []
    gutter = max(len(str(item.position.line)), 3)
    text, carets = snippet(line, item.position.column, item.position.length, columns - gutter - 5)
    return [
        f"  {paint(f'{item.position.line:>{gutter}} |', '2')} {text}",
        f"  {paint(' ' * gutter + ' |', '2')} {paint(carets, f'1;{color}')}",
    ]


def _allowed(values: Sequence[str]) -> str:
    shown = ", ".join(shorten(value, 200) for value in values[:_SHOWN_ALLOWED])
    rest = len(values) - _SHOWN_ALLOWED
    return f"{shown} and {rest} more" if rest > 0 else shown


def _labelled(label: str, text: str, columns: int) -> list[str]:
    return textwrap.wrap(
        clean(text),
        columns,
        initial_indent="  " + label.ljust(_LABEL_WIDTH),
        subsequent_indent=" " * (2 + _LABEL_WIDTH),
        break_long_words=False,
        break_on_hyphens=False,
    )


def snippet(line: str, column: int, length: int, columns: int) -> tuple[str, str]:
    """Return the visible part of a line and the carets below it.

    Args:
        line: source line without its end.
        column: first character of the span, from 1; length: characters of the span.
        columns: terminal columns that may be used.
    """
    first = min(max(column - 1, 0), len(line))
    last = min(first + max(length, 1), len(line) + 1)  # a caret may be one past the end
    if len(line) <= columns and line.isascii() and line.isprintable():
        return line.rstrip(), " " * first + "^" * (last - first)
    # Characters farther away never fit on the screen, so they are skipped.
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
    """Choose the cells to show: all, or a part around the span with room for the ellipses."""
    if sum(width for _, width in cells) <= columns:
        return 0, len(cells), False, False
    room = columns - 2 * len(_ELISION)
    start = min(first, len(cells))
    # A third of the width shows the text before the span, the rest the span and the text after it.
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


def cell(character: str) -> tuple[str, int]:
    """Return the text for one character and its number of columns.

    Control characters become their visible pictures; surrogates and direction overrides, which can
    break or reorder the output, become the replacement character.
    """
    code = ord(character)
    if 0x20 <= code < 0x7F:
        return character, 1
    if character == "\t":
        return " " * TAB_WIDTH, TAB_WIDTH
    if code < 0x20:
        return chr(_CONTROL_PICTURES + code), 1
    if code == 0x7F:
        return "\N{SYMBOL FOR DELETE}", 1
    category = unicodedata.category(character)
    if category in ("Cc", "Cs", "Cn", "Co", "Zl", "Zp"):
        return _REPLACEMENT, 1
    if category in ("Cf", "Mn", "Me"):
        if category == "Cf" and unicodedata.bidirectional(character) != "BN":
            return _REPLACEMENT, 1
        return character, 0
    return character, 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1


def clean(text: str) -> str:
    """Make text safe to print on one line."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(cell(character)[0] for character in text)


def width(text: str) -> int:
    """Columns of a text on a terminal."""
    return len(text) if text.isascii() else sum(cell(character)[1] for character in text)


def shorten(text: str, limit: int) -> str:
    """Make text safe, and cut its middle if it takes more than ``limit`` columns."""
    if len(text) > 4 * limit:  # limits the work for a huge string
        text = text[: 2 * limit] + text[-2 * limit :]
    shown = clean(text)
    if width(shown) <= limit:
        return shown
    half = (limit - 3) // 2
    return f"{_prefix(shown, half)}...{_prefix(shown[::-1], half)[::-1]}"


def _prefix(text: str, columns: int) -> str:
    taken = 0
    for index, character in enumerate(text):
        taken += cell(character)[1]
        if taken > columns:
            return text[:index]
    return text


def render_json(diagnostics: Iterable[Diagnostic], sources: Mapping[str, str] | None = None) -> str:
    """Render findings as a JSON array, sorted by file and position.

    Each object has ``code``, ``severity`` (``error``, ``warning`` or ``note``), ``message``, ``file``,
    ``line``, ``column``, ``end_line``, ``end_column``, ``field_path``, ``found``, ``allowed`` (list, nearest
    first), ``remedy`` and ``related`` (objects with ``label`` and a place). Lines and columns count from 1,
    columns in characters (Unicode code points); ``end_column`` is the column after the last character. A
    finding without a position in a file has ``null`` for ``file``, line and columns.

    Args:
        diagnostics: findings in any order.
        sources: file name to text, root file first; decides the order of the files.
    """
    import json  # imported here, because findings are mostly shown as text

    rows = [_row(item) for item in in_order(diagnostics, sources or {})]
    return json.dumps(rows, indent=2, ensure_ascii=True)


def _row(item: Diagnostic) -> dict[str, Any]:
    return {
        "code": item.code,
        "severity": item.severity.value,
        "message": item.message,
        **_place(item.position),
        "field_path": item.field_path,
        "found": item.found,
        "allowed": list(item.allowed),
        "remedy": item.remedy,
        "related": [{"label": other.label, **_place(other.position)} for other in item.related],
    }


def _place(position: Position | None) -> dict[str, Any]:
    if position is None:
        return dict.fromkeys(("file", "line", "column", "end_line", "end_column"))
    return {
        "file": position.file,
        "line": position.line,
        "column": position.column,
        "end_line": position.line,
        "end_column": position.column + position.length,
    }
