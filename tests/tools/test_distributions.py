"""Every distribution of the repository is laid out alike: src, typed, named and described."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nox
import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = [
    ROOT / "joshua-core",
    *(path.parent for path in sorted(ROOT.glob("joshua-plugins/*/pyproject.toml"))),
    *(path.parent for path in sorted(ROOT.glob("docs/examples/*/pyproject.toml"))),
]

# Libraries that stand on nothing of JOSHUA, and that the host need not find.
LIBRARIES = ("jobs", "preview")


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_distribution_is_typed_and_says_what_it_needs(folder: Path):
    project: dict[str, Any] = nox.project.load_toml(folder / "pyproject.toml")["project"]
    assert project["name"] == (
        folder.name if folder.parent.name != "joshua-plugins" else f"joshua-{folder.name}"
    )
    assert project["license"] == "Apache-2.0"
    assert project["requires-python"] == ">=3.10"
    assert (folder / project["readme"]).is_file()
    (package,) = (path for path in (folder / "src").iterdir() if (path / "__init__.py").is_file())
    assert (package / "py.typed").is_file()
    assert list(folder.glob("*.py")) == []
    is_library = folder.name in LIBRARIES
    if folder.name != "joshua-core":
        assert ("joshua-core" in project["dependencies"]) is not is_library
        assert (
            bool({"joshua.plugins", "joshua.commands"} & set(project.get("entry-points", ())))
            is not is_library
        )
