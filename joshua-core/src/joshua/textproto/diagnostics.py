"""Collects what reading finds wrong; diagnostics are made only when there is something to say."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from joshua.textproto.codes import reading_codes
from joshua.textproto.limits import MAX_PROBLEMS

# Syntax errors that belong to the field around them.
_INSIDE_FIELD = frozenset(
    (
        "missing-colon",
        "missing-value",
        "missing-brace",
        "missing-comma",
        "extra-comma",
        "unclosed-string",
        "unclosed-list",
        "unquoted-string",
    )
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from joshua.plan import Diagnostic
    from joshua.textproto.source import Source


class Span(NamedTuple):
    """A piece of a text: offsets of its first character and of the one after its last."""

    source: Source
    start: int
    end: int


class Diagnostics:
    """The problems of one load, in the order in which they stand in the files."""

    def __init__(self) -> None:
        self._found: list[tuple[int, int, Diagnostic]] = []
        self._file_order: dict[str, int] = {}

    @property
    def full(self) -> bool:
        """Whether so many problems are known that looking for more helps nobody."""
        return len(self._found) >= MAX_PROBLEMS

    def __len__(self) -> int:
        return len(self._found)

    def register(self, file: str) -> None:
        """Fixes the place of a file in the order of problems; the first one registered comes first."""
        self._order_of(file)

    def error(
        self,
        code: str,
        message: str,
        at: Span | None,
        *,
        path: str = "",
        found: str = "",
        allowed: Iterable[str] = (),
        remedy: str = "",
        related: Iterable[tuple[Span, str]] = (),
        is_note: bool = False,
    ) -> None:
        """Adds an error, or a note; the remedy of the code's table row stands in for an empty one."""
        if self.full:
            return
        from joshua.plan import Diagnostic, Related, Severity

        diagnostic = Diagnostic(
            code=code,
            severity=Severity.NOTE if is_note else Severity.ERROR,
            message=message,
            position=at.source.position(at.start, at.end) if at is not None else None,
            field_path=path,
            found=shortened(found),
            allowed=tuple(allowed),
            remedy=remedy or reading_codes()[code].next_step,
            related=tuple(
                Related(position=span.source.position(span.start, span.end), label=label)
                for span, label in related
            ),
        )
        order = self._order_of(at.source.name) if at is not None else -1
        self._found.append((order, at.start if at is not None else 0, diagnostic))

    def locate(self, source: Source, fields: list[tuple[int, int, str]]) -> None:
        """Gives syntax errors the path of the field that they stand in.

        Args:
            fields: offsets and path of each field of the text, in the order of their beginning.
        """
        starts = [start for start, _, _ in fields]
        for number, (order, at, diagnostic) in enumerate(self._found):
            place = diagnostic.position
            if diagnostic.field_path or place is None or place.file != source.name:
                continue
            index = bisect_right(starts, at) - 1
            if diagnostic.code in _INSIDE_FIELD and index >= 0 and at <= fields[index][1]:
                located = replace(diagnostic, field_path=fields[index][2])
                self._found[number] = (order, at, located)

    @property
    def items(self) -> list[Diagnostic]:
        """All of them, file by file and from top to bottom."""
        ordered = sorted(self._found, key=lambda item: item[:2])
        result = [diagnostic for _, _, diagnostic in ordered]
        if self.full:
            from joshua.plan import Diagnostic, Severity

            result.append(
                Diagnostic(
                    code="too-many-problems",
                    severity=Severity.ERROR,
                    message=f"Reading stopped after {MAX_PROBLEMS} problems; there may be more.",
                    remedy=reading_codes()["too-many-problems"].next_step,
                )
            )
        return result

    def _order_of(self, file: str) -> int:
        return self._file_order.setdefault(file, len(self._file_order))


def shortened(text: str, most: int = 80) -> str:
    """Cuts a text that would fill the screen."""
    return text if len(text) <= most else text[: most - 1] + "…"
