"""Findings of settings models that only repeat, in other words, what reading and checking have found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from joshua.config.positions import Positions, parent
from joshua.plan import Diagnostic, Severity

#: A range of the schema may be wider than what the plugin knows of its device: both are worth reading.
_TOLD_APART = "out-of-range"


def without_echoes(
    known: Iterable[Diagnostic], findings: Sequence[Diagnostic], positions: Positions
) -> list[Diagnostic]:
    """Leaves out the broken rules of settings models that follow from an error that is known.

    That is an error at the same field or inside it. Where the field is not written at all, it is also an
    error about its block or about a field beside it, such as a misspelt name.

    Args:
        known: findings of reading and checking.
        findings: of planning.
        positions: what is written.
    """
    errors = [item for item in known if item.severity is Severity.ERROR and item.field_path]
    broken = {item.field_path for item in errors if item.code != _TOLD_APART}
    around = {part for path in broken for part in _around(path)}
    beside = {parent(path) for path in broken}

    def is_echo(item: Diagnostic) -> bool:
        path = item.field_path
        if item.code != "invalid-setting" or not path:
            return False
        if path in broken or path in around:
            return True
        return not positions.is_set(path) and (parent(path) in broken or parent(path) in beside)

    return [item for item in findings if not is_echo(item)]


def _around(path: str) -> Iterable[str]:
    """Every path around a path, from the inside to the outside."""
    while path := parent(path):
        yield path
