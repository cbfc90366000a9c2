"""The syntax tree of a configuration text with positions, independent of the schema.

Each part has the offsets of its first character and of the one after its last, including brackets.
"""

from __future__ import annotations

from enum import Enum

# Plain classes, because importing dataclasses with slots takes longer than reading a whole file.


class ScalarKind(Enum):
    """The notation of a scalar."""

    STRING = "string"
    NUMBER = "number"
    NAME = "name"
    RAW = "raw"  # a string without quotes, taken literally
    BROKEN = "broken"  # reported already; carries no value


class Scalar:
    """A string, number or name. Adjacent strings are several literals.

    Attributes:
        kind: its notation; texts: the literals; parts: their offsets.
    """

    __slots__ = ("end", "kind", "parts", "start", "texts")

    def __init__(
        self, kind: ScalarKind, start: int, end: int, texts: list[str], parts: list[tuple[int, int]]
    ) -> None:
        self.kind, self.start, self.end, self.texts, self.parts = kind, start, end, texts, parts


class Block:
    """Fields between brackets."""

    __slots__ = ("end", "fields", "start")

    def __init__(self, start: int, end: int, fields: list[Field]) -> None:
        self.start, self.end, self.fields = start, end, fields


class ListValue:
    """Entries between square brackets."""

    __slots__ = ("end", "items", "start")

    def __init__(self, start: int, end: int) -> None:
        self.start, self.end = start, end
        self.items: list[Scalar | Block] = []


Value = Scalar | Block | ListValue


class Field:
    """One field with its value.

    Attributes:
        name: of the field, or the type between square brackets.
        name_start, name_end: offsets of the name, including brackets.
        is_type: whether the name is in square brackets.
        has_colon: whether a colon follows the name.
        value: None if it is missing, which has been reported.
        end: offset after the value, without a separator.
        separator: the comma or semicolon after it; "" for none.
    """

    __slots__ = ("end", "has_colon", "is_type", "name", "name_end", "name_start", "separator", "value")

    def __init__(self, name: str, name_start: int, name_end: int, *, is_type: bool = False) -> None:
        self.name, self.name_start, self.name_end, self.is_type = name, name_start, name_end, is_type
        self.has_colon = False
        self.value: Value | None = None
        self.end = 0
        self.separator = ""
