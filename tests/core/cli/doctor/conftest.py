"""A machine whose files lie in a temporary folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.doctor.host import Host
from usb_host import MakeHost

USER, GROUP = 4711, 4712


@pytest.fixture
def make_host(tmp_path: Path) -> MakeHost:
    """Writes files below the root and makes a host for an ordinary user."""

    def make(files: dict[str, str] | None = None, *, groups: tuple[int, ...] = ()) -> Host:
        for name, text in (files or {}).items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return Host(tmp_path, USER, groups, "ada")

    return make
