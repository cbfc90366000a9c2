"""The table of diagnostic codes, by groups of rules.

The rows are in ``codes.json`` here and, for parsing, beside ``joshua.textproto.diagnostics``. The
documentation prints them, and a test checks that every code has a row.
"""

from __future__ import annotations

from pathlib import Path

from joshua.textproto.diagnostics import CodeDoc, read_codes, reading_codes

GROUPS: dict[str, dict[str, CodeDoc]] = {
    "reading": reading_codes(),
    **read_codes(Path(__file__).with_suffix(".json")),
}

CODES: dict[str, CodeDoc] = {code: row for rows in GROUPS.values() for code, row in rows.items()}
