"""Messages as people see them, one for each diagnostic code, from the corpus of broken files."""

from __future__ import annotations

import re
from pathlib import Path

CORPUS = Path(__file__).resolve().parents[2] / "tests" / "core" / "config" / "bad"

_HEAD = re.compile(r"(?:\S+:\d+:\d+: )?(error|warning|note): (.+) \[([a-z0-9-]+)\]")


def example_messages() -> dict[str, str]:
    """Returns a message for each code that the corpus shows, with its severity, set as code."""
    found: dict[str, str] = {}
    for path in sorted(CORPUS.glob("*.expected")):
        for finding in path.read_text(encoding="utf-8").split("\n\n"):
            match = _HEAD.match(_headline(finding))
            if match is not None:
                text = f"{match[1]}: {match[2]}"
                found.setdefault(match[3], text if "`" in text else f"`{text}`")
    return found


def _headline(finding: str) -> str:
    """The message of a finding, which may take several lines: up to the code in brackets."""
    end = re.search(r"\[[a-z0-9-]+\]$", finding, re.MULTILINE)
    return " ".join(finding[: end.end()].split()) if end is not None else ""
