"""The known names that look most like a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable

# Beyond these sizes a suggestion costs more time than it is worth.
_MOST_CANDIDATES = 500
_LONGEST_NAME = 200
_SHORTEST_PART = 3


def nearest(name: str, candidates: Iterable[str], most: int = 3) -> list[str]:
    """Returns the candidates that resemble a name, the nearest first; may be empty."""
    known = list(dict.fromkeys(candidates))[:_MOST_CANDIDATES]
    if len(name) > _LONGEST_NAME:
        return []
    folded: dict[str, str] = {}
    for candidate in known:
        folded.setdefault(candidate.lower(), candidate)
    import difflib  # costs time that only an error is worth

    matches = difflib.get_close_matches(name.lower(), folded, n=most, cutoff=0.6)
    if not matches and len(name) >= _SHORTEST_PART:
        # MOCK stands for ACTION_MOCK: a part of a longer name between its underscores.
        matches = [known for known in folded if name.lower() in known.split("_")][:most]
    return [folded[match] for match in matches]


def nearest_first(name: str, candidates: Iterable[str]) -> list[str]:
    """Returns all candidates, those that resemble a name first."""
    known = list(dict.fromkeys(candidates))
    return list(dict.fromkeys([*nearest(name, known), *known]))
