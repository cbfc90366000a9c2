from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_hooks_run_what_lint_runs_and_fetch_nothing():
    text = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert re.findall(r"- repo: (.*)", text) == ["local"]
    entries = re.findall(r"entry: (.*)", text)
    assert re.findall(r"language: (.*)", text) == ["system"] * len(entries)
    session = (ROOT / "noxfile.py").read_text(encoding="utf-8").partition("def lint(")[2]
    for entry in entries:
        words = ", ".join(f'"{word}"' for word in entry.split()[:2])
        assert f"session.run({words}" in session
