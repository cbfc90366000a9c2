"""Small pieces of Markdown that the generated pages share."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

EXTENSION = '<span class="extension" title="extension of the specification">ext</span>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Makes the lines of a table, an empty one after it; a column without any content is left out."""
    rows = [[cell(text) for text in row] for row in rows]
    kept = [index for index in range(len(head)) if index == 0 or any(row[index] for row in rows)]
    lines = [f"| {' | '.join(head[index] for index in kept)} |", f"|{'---|' * len(kept)}"]
    lines += [f"| {' | '.join(row[index] for index in kept)} |" for row in rows]
    return [*lines, ""]


def cell(text: str) -> str:
    """Makes text fit for a table cell: one line, no column mark, backslashes as they are."""
    pieces = " ".join(text.split()).replace("|", "\\|").split("`")
    # Between backticks Markdown takes a backslash literally.
    pieces[::2] = [re.sub(r"\\(?!\|)", r"\\\\", piece) for piece in pieces[::2]]
    return "`".join(pieces)


def code(text: str) -> str:
    """Sets text as code; nothing for nothing."""
    return f"`{text}`" if text else ""


def anchor(name: str) -> str:
    """Name of the anchor of a message or enum."""
    return name.rpartition(".")[2].lower()
