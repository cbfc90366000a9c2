"""Findings of settings models that only repeat, in other words, what reading and checking have found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from joshua.plan import Diagnostic, Severity
from joshua.textproto.positions import Positions, parent

#: A range of the schema may be wider than what the plugin knows of its device: both are worth reading.
_TOLD_APART = "out-of-range"

#: Files that are not there, and the field whose files come with plugins too, which know the nearest of them.
_FILES = frozenset(("input-file-missing", "input-file-is-folder"))
_PACKAGED = "model_path"


def one_of_each(
    known: Sequence[Diagnostic], findings: Sequence[Diagnostic], positions: Positions
) -> list[Diagnostic]:
    """Puts the findings of checking and of planning together, without those that say the same.

    A broken rule of a settings model says the same as an error at its field or inside it. Where its field is
    not written at all, it says the same as an error about the block around it or about a field beside it,
    such as a misspelt name. Where a model is not there, the plugin's words stand and weigh as the check says.

    Args:
        known: findings of reading and checking.
        findings: of planning.
        positions: what is written.
    """
    errors = [item for item in known if item.severity is Severity.ERROR and item.field_path]
    files = {item.field_path: item for item in known if item.code in _FILES and _is_packaged(item)}
    broken = {item.field_path for item in errors if item.code != _TOLD_APART} - files.keys()
    around = {part for path in broken for part in _around(path)}
    beside = {parent(path) for path in broken}
    told: set[str] = set()

    def is_echo(item: Diagnostic) -> bool:
        path = item.field_path
        if item.code != "invalid-setting" or not path:
            return False
        if path in broken or path in around:
            return True
        block = _written(path, positions)
        return block != path and (block in broken or block in beside)

    kept = []
    for item in findings:
        if item.code == "invalid-setting" and item.field_path in files:
            told.add(item.field_path)
            missing = files[item.field_path]
            kept.append(replace(item, code=missing.code, severity=missing.severity))
        elif not is_echo(item):
            kept.append(item)
    return [*(item for item in known if not (item.code in _FILES and item.field_path in told)), *kept]


def _is_packaged(item: Diagnostic) -> bool:
    return item.field_path.rpartition(".")[2] == _PACKAGED


def _around(path: str) -> Iterable[str]:
    """Every path around a path, from the inside to the outside."""
    while path := parent(path):
        yield path


def _written(path: str, positions: Positions) -> str:
    """The path itself where it is written, else that of the innermost block around it that is."""
    while path and not positions.is_set(path):
        path = parent(path)
    return path
