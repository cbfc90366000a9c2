"""The changelog page: ``CHANGELOG.md`` with a draft of what its next release will say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MARK = "<!-- towncrier release notes start -->\n"


def changelog_page() -> str:
    """Makes the page, unreleased changes first."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    head, found, past = text.partition(MARK)
    if not found:
        raise ValueError(f"CHANGELOG.md has no line {MARK.strip()}, below which towncrier writes")
    return f"{head}{unreleased()}\n{past}"


def unreleased() -> str:
    """Collects the fragments in ``changes/`` without removing them; empty when there are none."""
    draft = subprocess.run(
        [sys.executable, "-m", "towncrier", "build", "--draft", "--version", "Unreleased"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    _, _, changes = draft.partition("\n### ")
    return f"## Unreleased\n\n### {changes}" if changes else ""
