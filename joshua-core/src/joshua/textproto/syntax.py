"""The syntax tree of a configuration text: what is written, where, before any schema is asked."""

from __future__ import annotations

from enum import Enum

# Plain classes: making dataclasses with slots costs more at import than reading a whole file does.


class ScalarKind(Enum):
    """How a scalar is written."""

    STRING = "string"
    NUMBER = "number"
    NAME = "name"
    RAW = "raw"  # a string without quotes, taken as it stands
    BROKEN = "broken"  # reported already; carries no value


class Scalar:
    """A string, number or name.

    Attributes:
        kind: how it is written; start, end: its offsets.
        texts: the literals as they are written; adjacent strings are several.
        parts: offsets of the literals.
    """

    __slots__ = ("end", "kind", "parts", "start", "texts")

    def __init__(
        self, kind: ScalarKind, start: int, end: int, texts: list[str], parts: list[tuple[int, int]]
    ) -> None:
        self.kind = kind
        self.start = start
        self.end = end
        self.texts = texts
        self.parts = parts


class Block:
    """Fields between brackets; ``start`` is the opening one, ``end`` the offset after the closing one."""

    __slots__ = ("end", "fields", "start")

    def __init__(self, start: int, end: int, fields: list[Field] | None = None) -> None:
        self.start = start
        self.end = end
        self.fields: list[Field] = [] if fields is None else fields


class ListValue:
    """Entries between square brackets."""

    __slots__ = ("end", "items", "start")

    def __init__(self, start: int, end: int) -> None:
        self.start = start
        self.end = end
        self.items: list[Scalar | Block] = []


Value = Scalar | Block | ListValue


class Field:
    """One field with its value.

    Attributes:
        name: of the field, or the type between square brackets.
        name_start, name_end: offsets of the name, brackets included.
        is_type: whether the name stands in square brackets.
        has_colon: whether a colon follows the name.
        value: None where it is missing, which has been reported.
        end: offset after the value, a separator not included.
        separator: the comma or semicolon after it; "" for none.
    """

    __slots__ = ("end", "has_colon", "is_type", "name", "name_end", "name_start", "separator", "value")

    def __init__(
        self,
        name: str,
        name_start: int,
        name_end: int,
        *,
        is_type: bool = False,
        has_colon: bool = False,
        value: Value | None = None,
        end: int = 0,
    ) -> None:
        self.name = name
        self.name_start = name_start
        self.name_end = name_end
        self.is_type = is_type
        self.has_colon = has_colon
        self.value = value
        self.end = end
        self.separator = ""
