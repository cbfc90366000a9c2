"""Collects the problems of reading. Diagnostics are made only if there are any."""

from __future__ import annotations

import json
from bisect import bisect_right
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from joshua.textproto.limits import MAX_PROBLEMS
from joshua.textproto.source import Span as Span

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from joshua.plan import Diagnostic
    from joshua.textproto.source import Source

# Prefixes of the codes of syntax errors that belong to the enclosing field.
_INSIDE_FIELD = ("missing-", "extra-comma", "unclosed-string", "unclosed-list", "unquoted-string")


class CodeDoc(NamedTuple):
    """One row of the table of diagnostic codes: the cause and the next step, one sentence each.

    ``reads`` lists what the rule reads besides its own field, see ``joshua.config.checks.taint``.
    """

    cause: str
    next_step: str
    reads: str = ""


def read_codes(path: Path) -> dict[str, dict[str, CodeDoc]]:
    """Read the rows of a ``codes.json`` by group and code."""
    groups = json.loads(path.read_text(encoding="utf-8"))
    return {group: {code: CodeDoc(**row) for code, row in rows.items()} for group, rows in groups.items()}


@cache
def reading_codes() -> dict[str, CodeDoc]:
    """The codes of reading a text: files, syntax, names and values, includes, and ``--set``."""
    from pathlib import Path  # only a file with problems needs it

    return read_codes(Path(__file__).with_name("codes.json"))["reading"]


class Diagnostics:
    """The problems of one load, in the order of the files."""

    def __init__(self) -> None:
        self._found: list[tuple[int, int, Diagnostic]] = []
        self._file_order: dict[str, int] = {}

    @property
    def full(self) -> bool:
        """Whether the limit of problems is reached, so that searching for more is useless."""
        return len(self._found) >= MAX_PROBLEMS

    def __len__(self) -> int:
        return len(self._found)

    def register(self, file: str) -> int:
        """Adds a file to the order of problems. The first one registered comes first."""
        return self._file_order.setdefault(file, len(self._file_order))

    def error(
        self,
        code: str,
        message: str,
        at: Span | None,
        *,
        path: str = "",
        found: str | None = None,
        allowed: Iterable[str] = (),
        remedy: str = "",
        related: Iterable[tuple[Span, str]] = (),
        is_note: bool = False,
    ) -> None:
        """Adds an error, or a note.

        Args:
            found: None for the text at the position; remedy: "" for the one in the code table.
        """
        if self.full:
            return
        from joshua.plan import Diagnostic, Related, Severity

        if found is None:
            found = at.text if at is not None else ""
        diagnostic = Diagnostic(
            code=code,
            severity=Severity.NOTE if is_note else Severity.ERROR,
            message=message,
            position=at.position if at is not None else None,
            field_path=path,
            found=shortened(found),
            allowed=tuple(allowed),
            remedy=remedy or reading_codes()[code].next_step,
            related=tuple(Related(position=span.position, label=label) for span, label in related),
        )
        place = (self.register(at.source.name), at.start) if at is not None else (-1, 0)
        self._found.append((*place, diagnostic))

    def locate(self, source: Source, fields: list[tuple[int, int, str]]) -> None:
        """Gives syntax errors the path of their field.

        Args:
            fields: offsets and path of each field of the text, in order of their start.
        """
        starts = [start for start, _, _ in fields]
        for number, (order, at, diagnostic) in enumerate(self._found):
            place = diagnostic.position
            if diagnostic.field_path or place is None or place.file != source.name:
                continue
            index = bisect_right(starts, at) - 1
            if diagnostic.code.startswith(_INSIDE_FIELD) and index >= 0 and at <= fields[index][1]:
                self._found[number] = (order, at, replace(diagnostic, field_path=fields[index][2]))

    @property
    def items(self) -> list[Diagnostic]:
        """All of them, file by file and from top to bottom."""
        result = [diagnostic for _, _, diagnostic in sorted(self._found, key=lambda item: item[:2])]
        if self.full:
            from joshua.plan import Diagnostic, Severity

            message = f"Reading stopped after {MAX_PROBLEMS} problems; there may be more."
            remedy = reading_codes()["too-many-problems"].next_step
            result.append(Diagnostic("too-many-problems", Severity.ERROR, message, remedy=remedy))
        return result


def shortened(text: str, most: int = 80) -> str:
    """Shortens a text that would fill the screen."""
    return text if len(text) <= most else text[: most - 1] + "…"
