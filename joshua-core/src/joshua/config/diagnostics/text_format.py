"""Findings as text: place, message, source line with caret, found, allowed, what to do, other places."""

from __future__ import annotations

import os
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TextIO

from joshua.config.diagnostics.cells import clean, shorten
from joshua.config.diagnostics.order import in_order
from joshua.config.diagnostics.snippet import Lines, snippet
from joshua.plan import Diagnostic, Severity

_SHOWN_ALLOWED = 8
_SHOWN_RELATED = 5
_COLORS = {Severity.ERROR: "31", Severity.WARNING: "33", Severity.NOTE: "36"}
_LABEL_WIDTH = 9
_COLUMNS, _NARROWEST, _WIDEST = 80, 40, 120


def wants_color(stream: TextIO, environment: Mapping[str, str] | None = None) -> bool:
    """Whether output to a stream is coloured: a terminal, NO_COLOR unset or empty, TERM not ``dumb``."""
    values = os.environ if environment is None else environment
    return stream.isatty() and not values.get("NO_COLOR") and values.get("TERM") != "dumb"


def columns_of(stream: TextIO) -> int:
    """Columns that lines for a stream are made for: those of its terminal, within reason; 80 for others."""
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
    """Renders findings for people, sorted by file and position, with a summary line at the end.

    Args:
        diagnostics: findings in any order.
        sources: file name to text, root file first.
        color: whether ANSI colours are used; see ``wants_color``.
        columns: terminal width that lines are made for.

    Returns:
        Text that ends with a line break; "" when there are no findings.
    """
    ordered = in_order(diagnostics, sources)
    if not ordered:
        return ""
    lines = Lines(dict(sources))
    paint = _Paint(color)
    blocks = [_finding(item, lines, paint, columns) for item in ordered]
    return "\n\n".join([*blocks, summary(ordered, sources)]) + "\n"


def summary(diagnostics: Sequence[Diagnostic], sources: Mapping[str, str]) -> str:
    """Counts findings, as in ``3 errors, 1 warning in robot.pbtxt``."""
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


class _Paint:
    """Wraps text in ANSI colours, or leaves it as it is."""

    def __init__(self, enabled: bool) -> None:
        self._enabled = enabled

    def __call__(self, text: str, style: str) -> str:
        return f"\x1b[{style}m{text}\x1b[0m" if self._enabled else text


def _finding(item: Diagnostic, lines: Lines, paint: _Paint, columns: int) -> str:
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


def _headline(item: Diagnostic, paint: _Paint, color: str, columns: int) -> list[str]:
    """Writes place, severity and message; the place comes first so that terminals and editors link it."""
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


def _source(item: Diagnostic, lines: Lines, paint: _Paint, color: str, columns: int) -> list[str]:
    if item.position is None:
        return []
    line = lines.get(item.position)
    if line is None or not line.strip():
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
