"""Edits of scalar fields in configuration files that preserve comments and layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from joshua.tools import spans

if TYPE_CHECKING:
    from collections.abc import Iterable

    from joshua.tools import Entry, Positions


class EditError(Exception):
    """A field cannot be written into the text. The message says where and why."""


@dataclass(frozen=True)
class Edit:
    """One change of one file's text: characters from ``start`` to ``end`` become ``text``."""

    file: str
    start: int
    end: int
    text: str


def set_strings(positions: Positions, block_path: str, values: dict[str, str]) -> list[Edit]:
    """Plan the edits that set string fields of a block in the text.

    An existing field keeps its place. A new one follows a neighbour, on its own line if the neighbour
    has one.

    Raises:
        EditError: the block is in no file, or is empty.
    """
    edits: list[Edit] = []
    anchor = _anchor(positions, block_path)
    added: list[str] = []
    for name, value in values.items():
        entry = positions.entry(f"{block_path}.{name}")
        if entry is None:
            added.append(f"{name}: {_quoted(value)}")
        else:
            span = entry.value
            edits.append(Edit(span.source.name, span.start, span.end, _quoted(value)))
    if added:
        edits.append(_addition(anchor, added))
    return edits


def apply_edits(text: str, edits: Iterable[Edit]) -> str:
    """Return the text after the edits. Raises EditError if it would no longer parse."""
    name = ""
    for edit in sorted(edits, key=lambda edit: edit.start, reverse=True):
        text = text[: edit.start] + edit.text + text[edit.end :]
        name = edit.file
    try:
        spans(text, "")
    except ValueError as error:
        raise EditError(f"{name}: the change would make the file unreadable: {error}") from error
    return text


def _anchor(positions: Positions, block_path: str) -> Entry:
    for name in ("port", "serial_number", "vid_pid", "baudrate"):
        entry = positions.entry(f"{block_path}.{name}")
        if entry is not None:
            return entry
    raise EditError(f"no file contains {block_path}: add comm {{ serial {{ port: … baudrate: … }} }} first")


def _addition(anchor: Entry, fields: list[str]) -> Edit:
    name, value = anchor.name, anchor.value
    text = value.source.text
    line_end = text.find("\n", value.end)
    line_end = len(text) if line_end < 0 else line_end
    rest = text[value.end : line_end].lstrip(" \t,;")
    if value.source.is_first_on_line(name.start) and (not rest or rest.startswith("#")):
        indentation = text[name.start - name.source.column(name.start) + 1 : name.start]
        added = "".join(f"\n{indentation}{field}" for field in fields)
        return Edit(value.source.name, line_end, line_end, added)
    return Edit(value.source.name, value.end, value.end, "".join(f" {field}" for field in fields))


def _quoted(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    if not escaped.isprintable():
        raise EditError(f"{value!r} contains characters that a configuration cannot contain")
    return f'"{escaped}"'
