"""The table of diagnostic codes as data: what causes each one and what to do about it."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple


class CodeDoc(NamedTuple):
    """One row of the table: the cause of a code and the next step, one sentence each."""

    cause: str
    next_step: str


def read_codes(path: Path) -> dict[str, dict[str, CodeDoc]]:
    """Reads the rows of a ``codes.json`` by group and code."""
    groups = json.loads(path.read_text(encoding="utf-8"))
    return {group: {code: CodeDoc(**row) for code, row in rows.items()} for group, rows in groups.items()}


@lru_cache(maxsize=1)
def reading_codes() -> dict[str, CodeDoc]:
    """The codes of reading a text: files, syntax, names and values, includes, and ``--set``."""
    return read_codes(Path(__file__).with_suffix(".json"))["reading"]
