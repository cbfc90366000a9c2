"""What the tests of configuration share: the way from a file to its findings."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.config.checks.taint import one_of_each
from joshua.config.loading import LoadedConfig
from joshua.modes import check_mode
from joshua.plan import Diagnostic

FIRST_LINES = re.compile(r"^# (set|launch)(?:: (.*))?$", re.MULTILINE)


def load_file(path: str) -> LoadedConfig:
    """Loads a file with the ``--set`` options that comments of the form ``# set: PATH=VALUE`` in it give."""
    text = Path(path).read_bytes().decode("utf-8", "replace")
    return load(path, overrides=[found[1] for found in FIRST_LINES.findall(text) if found[0] == "set"])


def findings_of(path: str) -> tuple[list[Diagnostic], dict[str, str]]:
    """Loads and checks a file as the command does; a comment ``# launch`` makes it a real start.

    Paths of this machine are replaced in the findings, so that they read the same everywhere.
    """
    loaded = load_file(path)
    launch = any(line.startswith("# launch") for line in loaded.sources.get(path, "").splitlines())
    found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded), *check_paths(loaded, launch=launch)]
    found = one_of_each(found, [], loaded.positions)
    here = str(Path.cwd())
    return [
        replace(
            item,
            message=item.message.replace(here, "/home/user"),
            remedy=item.remedy.replace(here, "/home/user"),
        )
        for item in found
    ], loaded.sources


@pytest.fixture
def examine() -> Callable[[str], tuple[list[Diagnostic], dict[str, str]]]:
    """The way from a file to its findings and sources."""
    return findings_of


@pytest.fixture
def check_text(tmp_path: Path) -> Callable[..., list[Diagnostic]]:
    """Findings of a configuration that is given as text."""

    def run(text: str, name: str = "robot.pbtxt") -> list[Diagnostic]:
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        return findings_of(str(file))[0]

    return run
