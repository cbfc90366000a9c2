"""How to install a distribution: out of the clone that this core runs from, else by its name.

In a clone nothing of this project is taken from a package index, where its names may be somebody else's.
"""

from __future__ import annotations

import os
import shlex
from functools import cache
from pathlib import Path

CORE = "joshua-core"
PREFIX = "joshua-"


@cache
def clone() -> Path | None:
    """The root of the clone that this core is installed from; None where it comes from a package."""
    root = Path(__file__).resolve().parents[4]
    return root if (root / "run").is_file() and (root / "joshua-plugins").is_dir() else None


def install(distribution: str) -> str:
    """The command that installs a distribution, or why there is none."""
    root = clone()
    if root is None or not distribution.startswith(PREFIX):
        return f"pip install {distribution}"
    if distribution == CORE:
        return f"pip install {target(CORE)}"
    name = distribution.removeprefix(PREFIX)
    if _folder(root, distribution).is_dir():
        return f"{_shown(root / 'run')} --with {name}"
    return f"this clone has no joshua-plugins/{name}"


def requires(distribution: str) -> str:
    """The end of a message that something needs a plugin: which one, and how to install it."""
    return f"requires the plugin {distribution}, which is not installed: {install(distribution)}"


def reinstall(distribution: str) -> str:
    """The command that installs a broken distribution anew."""
    options = "--force-reinstall" + (" --no-deps" if _is_cloned(distribution) else "")
    return f"pip install {options} {target(distribution)}"


def upgrade(distribution: str) -> str:
    """The command that brings a distribution up to date with the core."""
    if _is_cloned(distribution):
        return f"git pull && {install(distribution)}"
    return f"pip install --upgrade {distribution}"


def target(distribution: str) -> str:
    """What pip is to be given for a distribution: its folder in the clone, else its name."""
    root = clone()
    if root is None or not _is_cloned(distribution):
        return distribution
    return f"-e {_shown(_folder(root, distribution))}"


def _is_cloned(distribution: str) -> bool:
    root = clone()
    return root is not None and distribution.startswith(PREFIX) and _folder(root, distribution).is_dir()


def _folder(root: Path, distribution: str) -> Path:
    if distribution == CORE:
        return root / CORE
    return root / "joshua-plugins" / distribution.removeprefix(PREFIX)


def _shown(path: Path) -> str:
    """A path as the user can type it: from the present folder where that leads down, else in full."""
    try:
        relative = os.path.relpath(path)
    except (OSError, ValueError):
        return shlex.quote(str(path))
    return shlex.quote(str(path) if relative.startswith("..") else f"./{relative}")
