"""The known names most similar to a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable

# Beyond these sizes, a suggestion would take too long.
_MOST_CANDIDATES = 500
_LONGEST_NAME = 200
_SHORTEST_PART = 3


def nearest(name: str, candidates: Iterable[str], most: int = 3) -> list[str]:
    """Return the candidates similar to a name, the nearest first. May be empty."""
    known = list(dict.fromkeys(candidates))[:_MOST_CANDIDATES]
    if len(name) > _LONGEST_NAME:
        return []
    folded: dict[str, str] = {}
    for candidate in known:
        folded.setdefault(candidate.lower(), candidate)
    import difflib  # slow, so only for errors

    matches = difflib.get_close_matches(name.lower(), folded, n=most, cutoff=0.6)
    if not matches and len(name) >= _SHORTEST_PART:
        # MOCK matches ACTION_MOCK: a part of a longer name between underscores.
        matches = [known for known in folded if name.lower() in known.split("_")][:most]
    return [folded[match] for match in matches]


def nearest_first(name: str, candidates: Iterable[str]) -> list[str]:
    """Return all candidates, similar names first."""
    known = list(dict.fromkeys(candidates))
    return list(dict.fromkeys([*nearest(name, known), *known]))
