"""Finds installed plugins by their entry points; reads metadata only, imports nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata

ENTRY_POINT_GROUP = "joshua.plugins"
CORE_DISTRIBUTION = "joshua-core"


@dataclass(frozen=True)
class Candidate:
    """One entry point of the group ``joshua.plugins``, not imported.

    Attributes:
        name: name of the entry point; distribution, version: of the package that declares it.
        entry_point: what ``load`` imports.
    """

    name: str
    distribution: str
    version: str
    entry_point: metadata.EntryPoint

    @property
    def key(self) -> str:
        """Unique name within one host."""
        return f"{self.distribution}:{self.name}"


def normalise(name: str) -> str:
    """Spelling of a distribution's name by which two names compare equal (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def discover() -> list[Candidate]:
    """Lists the entry points of the group, the core's own first, then by distribution and name."""
    found: dict[str, Candidate] = {}
    for entry_point in metadata.entry_points(group=ENTRY_POINT_GROUP):
        distribution = entry_point.dist
        candidate = Candidate(
            name=entry_point.name,
            distribution=normalise(distribution.name) if distribution else "(unknown)",
            version=distribution.version if distribution else "",
            entry_point=entry_point,
        )
        found.setdefault(candidate.key, candidate)
    return sorted(found.values(), key=lambda c: (c.distribution != CORE_DISTRIBUTION, c.distribution, c.name))


def is_blocked(candidate: Candidate, blocked: Iterable[str]) -> bool:
    """Whether a list of names names this plugin, by its distribution or by its entry point."""
    names = {normalise(name) for name in blocked}
    return candidate.distribution in names or normalise(candidate.name) in names
