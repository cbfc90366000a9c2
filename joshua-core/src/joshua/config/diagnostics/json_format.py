"""Findings as JSON: one stable list of objects for editors and other programs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from joshua.config.diagnostics.text_format import in_order
from joshua.plan import Diagnostic, Position


def render_json(diagnostics: Iterable[Diagnostic], sources: Mapping[str, str] | None = None) -> str:
    """Renders findings as a JSON array, sorted by file and position.

    Each object has ``code``, ``severity`` (``error``, ``warning`` or ``note``), ``message``, ``file``,
    ``line``, ``column``, ``end_line``, ``end_column``, ``field_path``, ``found``, ``allowed`` (list,
    nearest first), ``remedy`` and ``related`` (objects with ``label`` and a place). Lines and columns
    count from 1, columns in characters (Unicode code points); ``end_column`` is the column after the
    last character. A finding about no place in a file has ``null`` for ``file``, line and columns.

    Args:
        diagnostics: findings in any order.
        sources: file name to text, root file first; decides the order of the files.
    """
    import json  # here, because findings are mostly shown as text

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
