"""Whether the braces of a text match, and whether its indentation can say where one is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.textproto.lexer import NAME, SIGN

if TYPE_CHECKING:
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source

_PARTNER = {"}": "{", ">": "<", "]": "["}
# Below this share of indented lines the layout of a file says nothing about its blocks.
_LAID_OUT = 0.5


def indentation_must_guide(source: Source, tokens: Tokens) -> bool:
    """Tells whether braces do not match while the file is indented well enough to find the faulty ones."""
    return not _braces_match(tokens) and _is_laid_out(source, tokens)


def _braces_match(tokens: Tokens) -> bool:
    open_signs: list[str] = []
    for kind, text in zip(tokens.kinds, tokens.texts, strict=True):
        if kind != SIGN:
            continue
        if text in "{<[":
            open_signs.append(text)
        elif text in _PARTNER and (not open_signs or open_signs.pop() != _PARTNER[text]):
            return False
    return not open_signs


def _is_laid_out(source: Source, tokens: Tokens) -> bool:
    """Counts the lines inside blocks that stand further right than the line of the outermost open block."""
    indented = lines = 0
    openers: list[int] = []
    last_line = 0
    for kind, start, text in zip(tokens.kinds, tokens.starts, tokens.texts, strict=True):
        line = source.line(start)
        if kind == NAME and line != last_line and openers:
            lines += 1
            indented += source.column(start) > openers[0]
        last_line = line
        if kind == SIGN and text in "{<":
            openers.append(source.indentation(start))
        elif kind == SIGN and text in "}>" and openers:
            openers.pop()
    return lines > 0 and indented >= _LAID_OUT * lines
