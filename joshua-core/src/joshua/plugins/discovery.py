"""Finds installed plugins by their entry points. Reads metadata only, without imports.

``importlib.metadata`` would do the same, but takes a tenth of the time limit for checking a file. So this
module reads the folders of the module path by the same rules: in each folder the ``entry_points.txt`` of
every installed distribution; the first one of a name counts (PyPA, "Recording installed projects" and "Entry
points specification"). If modules come from anything but folders, ``importlib.metadata`` is used.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

from joshua.plugins.specs import PluginSpec

ENTRY_POINT_GROUP = "joshua.plugins"
CORE_DISTRIBUTION = "joshua-core"


class PluginStatus(str, Enum):
    """The status of a plugin after verification."""

    OK = "ok"
    BROKEN = "broken"
    BLOCKED = "blocked"
    CONFLICT = "conflict"


@dataclass(frozen=True)
class PluginRow:
    """One plugin: a row of ``joshua plugins``.

    Attributes:
        name: of the entry point; distribution, version: of the package that declares it.
        module: target of the entry point: a module, or an object in it, such as ``acme_gripper.plugin``.
        reasons: for the status, one sentence each; specs: of the plugin, () for one not in use.
    """

    name: str
    distribution: str
    version: str
    status: PluginStatus = PluginStatus.OK
    reasons: tuple[str, ...] = ()
    specs: tuple[PluginSpec, ...] = ()
    module: str = ""

    @property
    def key(self) -> str:
        """Unique name within one host."""
        return f"{self.distribution}:{self.name}"


def normalise(name: str) -> str:
    """Normalise the name of a distribution (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def discover() -> list[PluginRow]:
    """List the entry points of the group, the core's first, then by distribution and name."""
    found: dict[str, PluginRow] = {}
    for row in _from_folders() if _only_folders() else _from_metadata():
        found.setdefault(row.key, row)
    return sorted(found.values(), key=lambda r: (r.distribution != CORE_DISTRIBUTION, r.distribution, r.name))


def is_blocked(row: PluginRow, blocked: Iterable[str]) -> bool:
    """Whether a list of names contains this plugin, by its distribution or entry point."""
    names = {normalise(name) for name in blocked}
    return row.distribution in names or normalise(row.name) in names


def _only_folders() -> bool:
    """Whether every entry of the module path is a folder or missing, and only folders are searched."""
    finders = [finder for finder in sys.meta_path if hasattr(finder, "find_distributions")]
    usual = all(getattr(finder, "__name__", "") == "PathFinder" for finder in finders)
    return usual and not any(place.endswith(".egg") or os.path.isfile(place) for place in sys.path)  # noqa: PTH113


def _from_folders() -> Iterator[PluginRow]:
    seen: set[str] = set()
    for place in dict.fromkeys(sys.path):
        try:
            folders = sorted(os.listdir(place or "."))  # noqa: PTH208 (hot, and no Path yet)
        except OSError:
            continue  # the module path may contain missing folders
        for folder in folders:
            if not folder.endswith((".dist-info", ".egg-info")):
                continue
            distribution = normalise(folder.rpartition(".")[0].partition("-")[0])
            if distribution not in seen:
                seen.add(distribution)
                yield from _of_distribution(f"{place}/{folder}" if place else folder)


def _of_distribution(folder: str) -> Iterator[PluginRow]:
    entry_points = _read(f"{folder}/entry_points.txt")
    if ENTRY_POINT_GROUP not in entry_points:
        return
    about = _read(f"{folder}/METADATA") or _read(f"{folder}/PKG-INFO")
    fields = dict(line.partition(":")[::2] for line in about.partition("\n\n")[0].splitlines())
    name, version = fields.get("Name", "(unknown)").strip(), fields.get("Version", "").strip()
    group = ""
    for line in map(str.strip, entry_points.splitlines()):
        if line.startswith("[") and line.endswith("]"):
            group = line[1:-1].strip()
        elif group == ENTRY_POINT_GROUP and not line.startswith(("#", ";")):
            entry, equals, target = line.partition("=")
            if equals and entry.strip():
                # Extras in brackets have no effect.
                module = target.partition("[")[0].strip()
                yield PluginRow(entry.strip(), normalise(name), version, module=module)


def _read(path: str) -> str:
    """The text of a file; "" if there is none."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:  # noqa: PTH123
            return file.read()
    except OSError:
        return ""


def _from_metadata() -> Iterator[PluginRow]:
    from importlib import metadata

    for point in metadata.entry_points(group=ENTRY_POINT_GROUP):
        name, version = (point.dist.name, point.dist.version) if point.dist else ("(unknown)", "")
        module = point.value.partition("[")[0].strip()
        yield PluginRow(point.name, normalise(name), version, module=module)
