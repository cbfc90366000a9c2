"""Whether two texts say the same: the last check before a formatted file replaces the original."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from joshua.textproto.syntax import Block, Field, ListValue, Scalar

if TYPE_CHECKING:
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Value


def same_content(one: tuple[Source, Tokens, list[Field]], other: tuple[Source, Tokens, list[Field]]) -> bool:
    """Tells whether two parsed texts hold the same fields, in the same order, and the same comments."""
    return _fields(one[2]) == _fields(other[2]) and _comments(one) == _comments(other)


def _fields(fields: list[Field]) -> list[object]:
    return [(field.name, field.is_type, _value(field.value)) for field in fields]


def _value(value: Value | None) -> object:
    if isinstance(value, Scalar):
        return (value.kind, value.texts)
    if isinstance(value, Block):
        return ("block", _fields(value.fields))
    if isinstance(value, ListValue):
        return ("list", [_value(item) for item in value.items])
    return None


def _comments(parsed: tuple[Source, Tokens, list[Field]]) -> Counter[str]:
    source, tokens, _ = parsed
    return Counter(source.text[start:end].rstrip() for start, end in tokens.comments)
