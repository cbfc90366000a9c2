"""Names of keys."""

from __future__ import annotations

#: Shows the help; cannot be mapped.
HELP_KEY = "?"

NAMED_KEYS = (
    *("up", "down", "left", "right", "space", "enter", "tab", "escape", "backspace"),
    *("home", "end", "page_up", "page_down", "insert", "delete"),
    *(f"f{number}" for number in range(1, 13)),
)


def canonical_key(name: str) -> str | None:
    """Return the key for a name in the file, case-insensitive for letters; None if there is none."""
    lowered = name.lower()
    if lowered in NAMED_KEYS:
        return lowered
    if name == " ":
        return "space"
    return lowered if len(lowered) == 1 and lowered.isprintable() else None
