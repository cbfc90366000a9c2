"""Characters as they stand on a terminal: width, tabs, and nothing that could steer the terminal."""

from __future__ import annotations

import unicodedata

TAB_WIDTH = 4
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_CONTROL_PICTURES = 0x2400


def cell(character: str) -> tuple[str, int]:
    """Returns what is shown for one character and how many columns it takes.

    Control characters become their visible pictures; surrogates and direction overrides, which can
    break or reorder the output, become the replacement character.
    """
    code = ord(character)
    if 0x20 <= code < 0x7F:
        return character, 1
    if character == "\t":
        return " " * TAB_WIDTH, TAB_WIDTH
    if code < 0x20:
        return chr(_CONTROL_PICTURES + code), 1
    if code == 0x7F:
        return "\N{SYMBOL FOR DELETE}", 1
    category = unicodedata.category(character)
    if category in ("Cc", "Cs", "Cn", "Co", "Zl", "Zp"):
        return _REPLACEMENT, 1
    if category in ("Cf", "Mn", "Me"):
        if category == "Cf" and unicodedata.bidirectional(character) != "BN":
            return _REPLACEMENT, 1
        return character, 0
    return character, 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1


def clean(text: str) -> str:
    """Makes text safe to print on one line."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(cell(character)[0] for character in text)


def width(text: str) -> int:
    """Columns that text takes on a terminal."""
    return len(text) if text.isascii() else sum(cell(character)[1] for character in text)


def shorten(text: str, limit: int) -> str:
    """Makes text safe and cuts its middle when it takes more than ``limit`` columns."""
    if len(text) > 4 * limit:  # so that a huge string costs nothing
        text = text[: 2 * limit] + text[-2 * limit :]
    shown = clean(text)
    if width(shown) <= limit:
        return shown
    half = (limit - 3) // 2
    return f"{_prefix(shown, half)}...{_prefix(shown[::-1], half)[::-1]}"


def _prefix(text: str, columns: int) -> str:
    taken = 0
    for index, character in enumerate(text):
        taken += cell(character)[1]
        if taken > columns:
            return text[:index]
    return text
