"""Valid files have no findings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from joshua.plan import Diagnostic

FOLDER = Path(__file__).parent / "good"


@pytest.mark.parametrize("name", sorted(path.name for path in FOLDER.glob("*.pbtxt")))
def test_a_valid_file_has_no_findings(
    name: str,
    examine: Callable[[str], tuple[list[Diagnostic], dict[str, str]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(FOLDER)
    assert examine(name)[0] == []
