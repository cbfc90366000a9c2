"""Splits a text into tokens of the protobuf text format.

The tokens are those of ``google.protobuf.text_format``, so that both read the same fields.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from joshua.textproto.limits import MAX_TOKENS

if TYPE_CHECKING:
    from joshua.textproto.source import Source

END = 0
NAME = 1
NUMBER = 2
STRING = 3
OPEN_STRING = 4  # missing closing quote
SIGN = 5
OTHER = 6  # a character that no field contains outside strings

_TOKEN = re.compile(
    r"\s*(?:"
    r"([a-zA-Z_][0-9a-zA-Z_+-]*)"
    r"|((?:[0-9+-]|\.[0-9])[0-9a-zA-Z_.+-]*)"
    r"|([\"'])"
    r"|(#[^\n]*)"
    r"|([{}<>\[\]:,;])"
    r"|(\S)"
    r"|\Z)"
)
_QUOTE, _COMMENT = 3, 4
_KIND_OF_GROUP = (END, NAME, NUMBER, STRING, END, SIGN, OTHER)
_STRING_STOP = re.compile(r"[\"'\\\n]")


class Tokens:
    """The tokens of one text, as parallel lists. The last one is always END.

    Attributes:
        kinds: kind of each token; starts, ends: its offsets; texts: the token itself.
        comments: offsets of each comment, with the # and without the line end.
        cut_at: offset at which a text with too many tokens was cut; None if all of it was read.
    """

    __slots__ = ("comments", "cut_at", "ends", "kinds", "starts", "texts")

    def __init__(self) -> None:
        self.kinds: list[int] = []
        self.starts: list[int] = []
        self.ends: list[int] = []
        self.texts: list[str] = []
        self.comments: list[tuple[int, int]] = []
        self.cut_at: int | None = None


def tokenize(source: Source, start: int = 0) -> Tokens:
    """Split a text into tokens, from an offset on."""
    tokens = Tokens()
    text = source.text
    kinds, starts, ends, texts = tokens.kinds, tokens.starts, tokens.ends, tokens.texts
    match_at = _TOKEN.match
    at = start
    while True:
        match = match_at(text, at)
        group = match.lastindex if match is not None else None
        if match is None or group is None:
            break
        begin, at = match.span(group)
        if len(kinds) + len(tokens.comments) >= MAX_TOKENS:
            tokens.cut_at = begin
            break
        if group == _COMMENT:
            tokens.comments.append((begin, at))
            continue
        kind = _KIND_OF_GROUP[group]
        if group == _QUOTE:
            at, closed = _string_end(text, begin)
            kind = STRING if closed else OPEN_STRING
        kinds.append(kind)
        starts.append(begin)
        ends.append(at)
        texts.append(text[begin:at])
    end = len(text) if tokens.cut_at is None else tokens.cut_at
    kinds.append(END)
    starts.append(end)
    ends.append(end)
    texts.append("")
    return tokens


def _string_end(text: str, start: int) -> tuple[int, bool]:
    """Find the end of a string: the offset, and whether it is closed by a quote."""
    quote = text[start]
    at = start + 1
    while True:
        stop = _STRING_STOP.search(text, at)
        if stop is None:
            return len(text), False
        at = stop.end()
        sign = stop.group()
        if sign == quote:
            return at, True
        if sign == "\n":
            return at - 1, False
        if sign == "\\":
            if at >= len(text) or text[at] == "\n":
                return at, False
            at += 1
