"""Broken files and exactly what is said about each of them.

To accept changed output after reading it: JOSHUA_WRITE_EXPECTED=1 pytest tests/core/config/test_corpus.py
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from joshua.config.diagnostics import render_json, render_text
from joshua.plan import Diagnostic

FOLDER = Path(__file__).parent / "bad"
NAMES = sorted(path.name for path in FOLDER.glob("*.pbtxt"))

Examine = Callable[[str], tuple[list[Diagnostic], dict[str, str]]]


def test_the_corpus_is_large() -> None:
    assert len(NAMES) >= 120


@pytest.mark.parametrize("name", NAMES)
def test_what_is_said_about_a_broken_file(
    name: str, examine: Examine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(FOLDER)
    diagnostics, sources = examine(name)
    text = render_text(diagnostics, sources)
    expected = FOLDER / name.replace(".pbtxt", ".expected")
    if os.environ.get("JOSHUA_WRITE_EXPECTED") == "1":
        expected.write_text(text, encoding="utf-8")
    assert diagnostics, "a broken file has findings"
    assert text == expected.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_every_finding_is_complete(name: str, examine: Examine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    diagnostics, sources = examine(name)
    for item in diagnostics:
        assert item.remedy, f"{item.code} says what to do"
        assert item.message[0] != " "
        assert item.message.endswith((".", "?", "!")), item.message
        if item.position is not None and item.position.file in sources:
            lines = sources[item.position.file].split("\n")
            assert 1 <= item.position.line <= len(lines)
            assert 1 <= item.position.column <= len(lines[item.position.line - 1]) + 1
            assert item.position.length >= 1


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_said_twice(name: str, examine: Examine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    diagnostics, _ = examine(name)
    places = [(item.code, str(item.position), item.field_path) for item in diagnostics]
    assert len(places) == len(set(places))


@pytest.mark.parametrize("name", NAMES)
def test_json_holds_the_same_findings(name: str, examine: Examine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    diagnostics, sources = examine(name)
    rows = json.loads(render_json(diagnostics, sources))
    assert sorted(row["message"] for row in rows) == sorted(item.message for item in diagnostics)


def test_no_expected_text_is_left_over() -> None:
    assert {path.stem for path in FOLDER.glob("*.expected")} == {Path(name).stem for name in NAMES}
