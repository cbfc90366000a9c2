"""The syntax tree of a configuration text: what is written, where, before any schema is asked."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class ScalarKind(Enum):
    """How a scalar is written."""

    STRING = "string"
    NUMBER = "number"
    NAME = "name"
    RAW = "raw"  # a string without quotes, taken as it stands
    BROKEN = "broken"  # reported already; carries no value


@dataclass(slots=True)
class Scalar:
    """A string, number or name.

    Attributes:
        parts: offsets of the literals; adjacent strings are several.
        texts: the literals as they are written.
    """

    kind: ScalarKind
    start: int
    end: int
    texts: list[str]
    parts: list[tuple[int, int]]


@dataclass(slots=True)
class Block:
    """Fields between brackets; ``start`` is the opening one, ``end`` the offset after the closing one."""

    start: int
    end: int
    fields: list[Field] = field(default_factory=list)


@dataclass(slots=True)
class ListValue:
    """Entries between square brackets."""

    start: int
    end: int
    items: list[Scalar | Block] = field(default_factory=list)


Value = Scalar | Block | ListValue


@dataclass(slots=True)
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

    name: str
    name_start: int
    name_end: int
    is_type: bool = False
    has_colon: bool = False
    value: Value | None = None
    end: int = 0
    separator: str = ""
