"""Generates the reference pages of the documentation from the schema, the program itself and the changes.

The pages land in ``docs/reference/`` and are not committed: they always fit the tree they are built from.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from reference.api import api_page
from reference.changelog import changelog_page
from reference.command_line import command_line_page
from reference.configuration import configuration_page
from reference.data_types import data_types_page
from reference.diagnostics import diagnostics_page
from reference.presets import presets_page

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "reference"

PAGES: dict[str, Callable[[], str]] = {
    "configuration.md": configuration_page,
    "data-types.md": data_types_page,
    "diagnostics.md": diagnostics_page,
    "command-line.md": command_line_page,
    "presets.md": presets_page,
    "api.md": api_page,
    "changelog.md": changelog_page,
}


def main() -> int:
    """Writes every generated page and returns the exit code."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, page in PAGES.items():
        path, text = FOLDER / name, page()
        # An unchanged page keeps its time stamp, so that a live preview does not rebuild for nothing.
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
