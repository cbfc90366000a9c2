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
    """The key that a name of the file stands for; letters in whatever case are one key. None for no key."""
    lowered = name.lower()
    if lowered in NAMED_KEYS:
        return lowered
    if name == " ":
        return "space"
    return lowered if len(lowered) == 1 and lowered.isprintable() else None
