"""The table of violations: complete, and used."""

from __future__ import annotations

import json
import re
from pathlib import Path

from joshua.testing import conformance

FOLDER = Path(conformance.__file__).parent
ROWS = json.loads((FOLDER / "violations.json").read_text(encoding="utf-8"))


def test_every_row_is_used_and_every_use_has_a_row() -> None:
    sources = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("*.py"))
    used = set(re.findall(r"\b(?:must|must_refuse|violation)\(\s*\"([^\"]+)\"", sources))
    assert used == set(ROWS)


def test_every_row_says_what_why_and_the_likely_cause() -> None:
    for row, texts in ROWS.items():
        assert len(texts) == 3, row
        assert all(texts), row
        assert not any(text.endswith(".") for text in texts), row
