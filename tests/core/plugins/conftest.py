from __future__ import annotations

import itertools
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

_numbers = itertools.count(1)
_NAMES = "hookimpl Environment EnvironmentSpec ActuatorSpec ModeOffer ModelSpec PluginSpec SensorSpec"


class PluginFolder:
    """A folder on ``sys.path`` that holds plugin distributions."""

    def __init__(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.path = path
        self.modules: list[str] = []
        monkeypatch.syspath_prepend(str(path))

    def add(self, distribution: str, source: str, *, version: str = "1.0", entry: str = "main") -> str:
        """Writes a distribution with one module; returns the name of the module."""
        module = f"{distribution.replace('-', '_')}_{next(_numbers)}"
        header = f"from joshua.plugins import {_NAMES.replace(' ', ', ')}\n"
        (self.path / f"{module}.py").write_text(header + textwrap.dedent(source), encoding="utf-8")
        info = self.path / f"{distribution.replace('-', '_')}-{version}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n", encoding="utf-8"
        )
        (info / "entry_points.txt").write_text(f"[joshua.plugins]\n{entry} = {module}\n", encoding="utf-8")
        self.modules.append(module)
        return module

    def forget(self) -> None:
        """Removes the imported modules from the interpreter."""
        for module in self.modules:
            sys.modules.pop(module, None)


@pytest.fixture
def plugin_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PluginFolder]:
    folder = PluginFolder(tmp_path, monkeypatch)
    yield folder
    folder.forget()
