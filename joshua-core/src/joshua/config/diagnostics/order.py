"""The order in which findings are shown: by file, then by position, the heavier first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from joshua.plan import Diagnostic, Severity

_WEIGHT = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.NOTE: 2}


def in_order(diagnostics: Iterable[Diagnostic], sources: Mapping[str, str]) -> list[Diagnostic]:
    """Sorts findings: without a place first, then in the order of ``sources``, then by line and column."""
    rank = {name: index for index, name in enumerate(sources)}

    def key(item: Diagnostic) -> tuple[int, str, int, int, int]:
        if item.position is None:
            return (-1, "", 0, 0, _WEIGHT[item.severity])
        place = item.position
        return (
            rank.get(place.file, len(rank)),
            place.file,
            place.line,
            place.column,
            _WEIGHT[item.severity],
        )

    return sorted(diagnostics, key=key)
