"""Formats configuration files in place: reads, formats, checks the result, replaces atomically."""

from __future__ import annotations

import contextlib
import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.config.files import decode_source, read_bytes
from joshua.textproto.diagnostics import Diagnostics
from joshua.textproto.formatting import format_source, same_content
from joshua.textproto.lexer import tokenize
from joshua.textproto.parser import Parser
from joshua.textproto.source import Source

if TYPE_CHECKING:
    from joshua.plan import Diagnostic


@dataclass(frozen=True)
class Formatted:
    """The outcome for one text.

    Attributes:
        text: formatted; None if there are diagnostics.
        is_changed: whether it differs from the original.
        diagnostics: why the text cannot be formatted; sources: for rendering them.
    """

    text: str | None
    is_changed: bool = False
    diagnostics: list[Diagnostic] = field(default_factory=list)
    sources: dict[str, str] = field(default_factory=dict)


def format_file(path: str) -> Formatted:
    """Format the text of a file without changing the file."""
    problems = Diagnostics()
    data = read_bytes(path, problems, None)
    return Formatted(None, diagnostics=problems.items) if data is None else format_bytes(path, data)


def format_bytes(name: str, data: bytes) -> Formatted:
    """Format a text, called ``name`` in diagnostics."""
    problems = Diagnostics()
    return _format(decode_source(name, data, problems, None), problems, data)


def replace_file(path: str, text: str) -> None:
    """Replace the content of a file atomically, keeping its mode.

    Raises:
        OSError: if the folder or the file cannot be written.
    """
    target = Path(path).resolve()
    status = target.stat()
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(text.encode())
            file.flush()
            os.fchmod(handle, status.st_mode & 0o7777)
            with contextlib.suppress(PermissionError):  # only root may change the owner of a file
                os.fchown(handle, status.st_uid, status.st_gid)
            os.fsync(handle)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _format(source: Source | None, problems: Diagnostics, original: bytes) -> Formatted:
    if source is None or len(problems):
        return Formatted(None, diagnostics=problems.items, sources=_sources(source))
    tokens = tokenize(source)
    fields = Parser(source, tokens, problems).document()
    if len(problems):
        return Formatted(None, diagnostics=problems.items, sources=_sources(source))
    text = format_source(source, tokens, fields)
    again = Source(source.name, text)
    again_tokens = tokenize(again)
    again_fields = Parser(again, again_tokens, problems).document()
    if len(problems) or not same_content((source, tokens, fields), (again, again_tokens, again_fields)):
        # No text is known for which this happens. If there is one, it must not be damaged.
        problems.error("format-refused", f"Formatting would change the content of {source.name}.", None)
        return Formatted(None, diagnostics=problems.items, sources=_sources(source))
    return Formatted(text, is_changed=text.encode() != original)


def _sources(source: Source | None) -> dict[str, str]:
    return {} if source is None else {source.name: source.text}
