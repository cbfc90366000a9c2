"""Prints the folders of plugins and of everything of this repository that they need, for one call of pip.

Given together, all these names are satisfied from here, and pip asks no package index for them, where they
may be somebody else's. ``all`` stands for every plugin; extras are written as in ``emulator[spike]``.
"""

from __future__ import annotations

import difflib
import re
import sys
from pathlib import Path
from typing import Any

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10; pip brings the same reader
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

ROOT = Path(__file__).resolve().parent.parent
CORE = "joshua-core"
_REQUIREMENT = re.compile(r"([A-Za-z0-9][A-Za-z0-9._-]*)\s*(?:\[([^\]]*)\])?")


class UnknownPlugin(Exception):
    """No folder of this repository holds a distribution of that name."""


def distributions() -> dict[str, Path]:
    """The distributions of this repository by name, each with its folder."""
    folders = [ROOT / CORE, *sorted(path.parent for path in ROOT.glob("joshua-plugins/*/pyproject.toml"))]
    return {_project(folder)["name"]: folder for folder in folders}


def closure(words: list[str]) -> dict[str, set[str]]:
    """Everything of this repository that plugins need, the core first, each with its extras.

    Args:
        words: names of plugins such as ``sts3215``, ``joshua-sts3215`` or ``emulator[spike]``; ``all``.

    Raises:
        UnknownPlugin: with the nearest names.
    """
    known = distributions()
    waiting = [CORE]
    for word in words:
        waiting += known if word == "all" else [_full_name(word, known)]
    found: dict[str, set[str]] = {}
    while waiting:
        name, extras = _parts(waiting.pop(0))
        if name not in known or (name in found and extras <= found[name]):
            continue
        found.setdefault(name, set()).update(extras)
        project = _project(known[name])
        waiting += project.get("dependencies", [])
        for extra in extras:
            waiting += project.get("optional-dependencies", {}).get(extra, [])
    return found


def requirements(found: dict[str, set[str]]) -> list[str]:
    """What distributions and their extras need that this repository does not hold."""
    known, needed = distributions(), []
    for name, extras in found.items():
        project = _project(known[name])
        optional = project.get("optional-dependencies", {})
        needed += [*project.get("dependencies", []), *(item for extra in extras for item in optional[extra])]
    return [requirement for requirement in needed if _parts(requirement)[0] not in known]


def left_out(found: dict[str, set[str]]) -> list[str]:
    """What distributions need to work in full and do not bring, as ``tool.joshua.left-out`` of each says."""
    folders = distributions()
    tables = (_table(folders[name]).get("tool", {}).get("joshua", {}) for name in found)
    return [table["left-out"] for table in tables if "left-out" in table]


def _full_name(word: str, known: dict[str, Path]) -> str:
    name, _ = _parts(word)
    for full in (name, f"joshua-{name}"):
        if full in known:
            return word if full == name else f"joshua-{word}"
    names = [item.removeprefix("joshua-") for item in known]
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
    rest = [item for item in names if item not in near]
    raise UnknownPlugin(f"joshua-plugins has no {word!r}; allowed: {', '.join([*near, *rest])}, all")


def _parts(requirement: str) -> tuple[str, set[str]]:
    match = _REQUIREMENT.match(requirement)
    if match is None:
        return requirement, set()
    extras = {extra.strip() for extra in (match[2] or "").split(",") if extra.strip()}
    return re.sub(r"[-_.]+", "-", match[1]).lower(), extras


def _table(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))


def _project(folder: Path) -> dict[str, Any]:
    project: dict[str, Any] = _table(folder)["project"]
    return project


def main(arguments: list[str]) -> int:
    """Prints one folder a line; 2 where a plugin is unknown."""
    words = [word for argument in arguments for word in re.split(r",(?![^\[]*\])|\s+", argument) if word]
    try:
        found = closure(words)
    except UnknownPlugin as error:
        sys.stderr.write(f"run: --with: {error}\n")
        return 2
    folders = distributions()
    for line in left_out(found):
        sys.stderr.write(f"run: {line}\n")
    for name, extras in found.items():
        suffix = f"[{','.join(sorted(extras))}]" if extras else ""
        sys.stdout.write(f"./{folders[name].relative_to(ROOT).as_posix()}{suffix}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
