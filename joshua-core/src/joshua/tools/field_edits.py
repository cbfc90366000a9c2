"""Change string fields of configuration files, all or none, and keep comments and layout."""

from __future__ import annotations

import difflib
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.config.format_file import replace_file
from joshua.plan import Severity
from joshua.tools.configuration import spans

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from joshua.config import LoadedConfig
    from joshua.textproto.positions import Entry, Positions


class EditError(Exception):
    """A field cannot be written into the text, or was not. The message says where and why.

    Args:
        code: exit code of the command that wanted to write it.
    """

    def __init__(self, message: str, code: ExitCode = ExitCode.INVALID) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class Edit:
    """One change of one file's text: characters from ``start`` to ``end`` become ``text``."""

    file: str
    start: int
    end: int
    text: str


def load_readable(path: str) -> LoadedConfig:
    """Load a configuration file whose text can be read without errors. Notes do not count.

    Args:
        path: of the file.

    Raises:
        EditError: it has errors. The message contains them.
    """
    from joshua.config import load
    from joshua.config.diagnostics import render_text
    from joshua.plugins import load_registry

    loaded = load(path, message_types=load_registry().message_modules())
    errors = [item for item in loaded.diagnostics if item.severity is Severity.ERROR]
    if errors:
        found = render_text(errors, loaded.sources, color=False).rstrip()
        raise EditError(f"{path} cannot be read:\n{found}")
    return loaded


def edited_texts(
    loaded: LoadedConfig, values: Mapping[str, Mapping[str, str]], neighbours: Sequence[str]
) -> dict[str, str]:
    """Return the new text of each file that changes.

    Args:
        loaded: the configuration.
        values: string fields to set, by the path of their block.
        neighbours: names of fields of the blocks; a new field follows the first of them that is set.

    Raises:
        EditError: a block is in no file, or has none of the neighbours.
    """
    edits: dict[str, list[Edit]] = {}
    for path, fields in values.items():
        for edit in _set_strings(loaded.positions, path, fields, neighbours):
            edits.setdefault(edit.file, []).append(edit)
    return {name: _apply(loaded.sources[name], items) for name, items in edits.items()}


def show_change(name: str, old: str, new: str) -> None:
    """Print the change of a file."""
    lines = difflib.unified_diff(
        old.splitlines(keepends=True), new.splitlines(keepends=True), name, name, n=2
    )
    for line in lines:
        sys.stdout.write(line if line.endswith("\n") else line + "\n")


def replace_texts(texts: Mapping[str, str], verify: Callable[[], None]) -> None:
    """Replace files and verify the result; restore all of them if that fails.

    Args:
        texts: new content by path. Line ends and byte order marks of the files are kept.
        verify: reads the files back. Raises EditError if anything differs.

    Raises:
        EditError: the files are as they were.
    """
    originals = {name: Path(name).read_bytes() for name in texts}
    try:
        for name, text in texts.items():
            replace_file(name, _in_style_of(originals[name], text))
        verify()
    except (OSError, EditError) as error:
        for name, data in originals.items():
            if Path(name).read_bytes() != data:
                replace_file(name, data.decode())
        raise EditError(f"the file was restored: {error}") from error


def _in_style_of(original: bytes, text: str) -> str:
    """Return text with the line ends and byte order mark of the original file."""
    mark = "\ufeff" if original.startswith(b"\xef\xbb\xbf") else ""
    return mark + (text.replace("\n", "\r\n") if b"\r\n" in original else text)


def _set_strings(
    positions: Positions, block_path: str, values: Mapping[str, str], neighbours: Sequence[str]
) -> list[Edit]:
    """Plan the edits of one block.

    An existing field keeps its place. A new one follows a neighbour, on its own line if the neighbour
    has one.
    """
    edits: list[Edit] = []
    anchor = _anchor(positions, block_path, neighbours)
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


def _apply(text: str, edits: Iterable[Edit]) -> str:
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


def _anchor(positions: Positions, block_path: str, neighbours: Sequence[str]) -> Entry:
    for name in neighbours:
        entry = positions.entry(f"{block_path}.{name}")
        if entry is not None:
            return entry
    raise EditError(f"no file contains {block_path} with one of {', '.join(neighbours)}: add one first")


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
