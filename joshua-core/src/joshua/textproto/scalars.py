"""Converts scalars of the syntax tree to field values. Errors name the expected type."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from joshua.textproto import literals
from joshua.textproto.diagnostics import shortened
from joshua.textproto.field_table import Kind
from joshua.textproto.nearest import nearest, nearest_first
from joshua.textproto.source import Span
from joshua.textproto.syntax import ListValue, Scalar, ScalarKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.field_table import FieldInfo
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Value


_NUMBER_WITH_UNIT = r"[-+]?[0-9]+(\.[0-9]+)?[^0-9.eE\s][^0-9\s]*"


class ScalarReader:
    """Reads the scalars of one text. Mismatches go to ``problems``."""

    def __init__(self, source: Source, problems: Diagnostics) -> None:
        self._source = source
        self._problems = problems

    def read(self, info: FieldInfo, value: Value, path: str) -> Any:
        """Return the value for a field; None for a mismatch, which is reported."""
        if not isinstance(value, Scalar):
            found = "a list" if isinstance(value, ListValue) else "a block"
            many = " for each entry" if info.is_repeated else ""
            self._wrong_type(info, value, path, f"takes a {info.type_text}{many}, not {found}")
            return None
        if value.kind is ScalarKind.BROKEN:
            return None
        if info.kind is Kind.STRING or info.kind is Kind.BYTES:
            return self._string(info, value, path)
        if value.kind is ScalarKind.STRING:
            self._quoted(info, value, path)
            return None
        text = value.texts[0]
        if info.kind is Kind.ENUM:
            return self._enum(info, value, text, path)
        if info.kind is Kind.INTEGER:
            return self._integer(info, value, text, path)
        found_value: float | bool | None
        if info.kind is Kind.BOOL:
            found_value, wanted = literals.boolean(text), "true or false"
            allowed = nearest_first(text, ("true", "false")) if found_value is None else []
        else:
            found_value, wanted, allowed = literals.number(text), "a number", []
        if found_value is None:
            self._wrong_type(info, value, path, f"takes {wanted}", allowed)
        return found_value

    def _integer(self, info: FieldInfo, value: Scalar, text: str, path: str) -> int | None:
        number = literals.integer(text)
        if number is not None and info.smallest <= number <= info.largest:
            if literals.is_octal(text):
                self._note_octal(info, value, text, number, path)
            return number
        if number is not None:
            limits = _limits_of(info)
            message = f"{info.name} takes whole numbers from {limits}."
            self._error("number-out-of-range", message, value, path, allowed=(limits,))
            return None
        near = literals.number(text)
        allowed: tuple[str, ...] = ()
        if near is not None and info.smallest <= near <= info.largest:
            low = int(near // 1)
            allowed = (str(low),) if low == near else (str(low), str(low + 1))
        self._wrong_type(info, value, path, "takes a whole number", allowed)
        return None

    def _note_octal(self, info: FieldInfo, value: Scalar, text: str, number: int, path: str) -> None:
        message = f"{info.name} is {number} here: {text} starts with a zero, so it is octal."
        sign = "-" if text.startswith("-") else ""
        decimal = f"{sign}{text.lstrip('-0')}"
        remedy = f"Write {number}, or {decimal} if you mean that number in decimal."
        self._problems.error(
            "number-octal", message, self._span(value), path=path, remedy=remedy, is_note=True
        )

    def _enum(self, info: FieldInfo, value: Scalar, text: str, path: str) -> int | None:
        number = literals.plain_integer(text)
        if number is not None:
            known = info.enum.values_by_number.get(number)  # which cuts a number to 32 bits
            if known is not None and known.number == number:
                return number
            message = f"{info.enum.name} has no value of number {number}."
            names = [f"{item.name} ({item.number})" for item in info.enum.values]
            self._error("unknown-enum-number", message, value, path, allowed=names)
            return None
        found = info.enum.values_by_name.get(text)
        if found is not None:
            return int(found.number)
        names = _names(info.enum)
        self._error(
            "unknown-enum-value",
            f"{info.enum.name} has no value {shortened(text)}.",
            value,
            path,
            allowed=nearest_first(text, names),
            remedy="".join(f"Did you mean {name}?" for name in nearest(text, names, most=1)),
        )
        return None

    def _quoted(self, info: FieldInfo, value: Scalar, path: str) -> None:
        """Reports a string for a field of another type, and its content without quotes."""
        text = "".join(literal[1:-1] for literal in value.texts)
        allowed = [info.type_text]
        remedy = ""
        if info.kind is Kind.ENUM:
            bare = _enum_name_of(info, text)
            allowed = nearest_first(bare, _names(info.enum))
            if bare.isascii() and bare in info.enum.values_by_name:
                remedy = f"Write {bare} without quotes."
                allowed = [bare]
        elif literals.number(text) is not None or literals.boolean(text) is not None:
            remedy = f"Write {text} without quotes."
        self._wrong_type(info, value, path, f"takes a {info.type_text}, not a string", allowed, remedy)

    def _string(self, info: FieldInfo, value: Scalar, path: str) -> str | bytes | None:
        if value.kind is ScalarKind.RAW:
            data = literals.encoded(value.texts[0])
        elif value.kind is ScalarKind.STRING:
            pieces = [
                self._piece(literal, start, path)
                for literal, (start, _) in zip(value.texts, value.parts, strict=True)
            ]
            if None in pieces:
                return None
            data = b"".join(piece for piece in pieces if piece is not None)
        else:
            quoted = f'"{shortened(value.texts[0])}"'
            self._wrong_type(info, value, path, f"takes a {info.type_text}", (quoted,), f"Write {quoted}.")
            return None
        if info.kind is Kind.BYTES:
            return data
        try:
            return data.decode()
        except UnicodeDecodeError as fault:
            message = f"The byte 0x{data[fault.start]:02x} of this string is not UTF-8 text."
            self._error("not-utf8-string", message, value, path)
            return None

    def _piece(self, literal: str, start: int, path: str) -> bytes | None:
        try:
            return literals.string_bytes(literal)
        except literals.BadEscapeError as fault:
            at = Span(self._source, start + fault.offset, start + fault.offset + fault.length)
            self._problems.error("bad-escape", f"{fault}.", at, path=path, found=str(fault).split(" ", 1)[0])
            return None

    def _wrong_type(
        self,
        info: FieldInfo,
        value: Value,
        path: str,
        takes: str,
        allowed: Sequence[str] = (),
        remedy: str = "",
    ) -> None:
        remedy = remedy or _number_remedy(info, self._span(value).text)
        allowed = allowed or (info.type_text,)
        self._error("wrong-type", f"{info.name} {takes}.", value, path, allowed=allowed, remedy=remedy)

    def _error(self, code: str, message: str, value: Value, path: str, **details: Any) -> None:
        self._problems.error(code, message, self._span(value), path=path, **details)

    def _span(self, value: Value) -> Span:
        return Span(self._source, value.start, value.end)


def _limits_of(info: FieldInfo) -> str:
    """The range of an integer field in words: that of its rule within that of its type."""
    from joshua.textproto.field_facts import facts_of, number_text

    facts = facts_of(info.descriptor)
    smallest = info.smallest if facts.minimum is None else facts.minimum
    largest = info.largest if facts.maximum is None else facts.maximum
    return f"{number_text(smallest)} to {number_text(largest)}"


def _number_remedy(info: FieldInfo, text: str) -> str:
    """The form of a number for this field; "" if it takes none."""
    if info.kind is not Kind.INTEGER and info.kind is not Kind.FLOAT:
        return ""
    from joshua.textproto.field_facts import facts_of

    facts = facts_of(info.descriptor)
    if facts.unit and re.fullmatch(_NUMBER_WITH_UNIT, text):
        return f"Write the number alone; the unit of {info.name} is {facts.unit}."
    sample = facts.example or facts.default
    what = f"a list of {info.type_text}s" if info.is_repeated else f"a {info.type_text}"
    return f"Write {what}, such as {sample}." if sample else ""


def _names(enum: Any) -> list[str]:
    """The names that a user may choose, without the one that means "not chosen"."""
    return [item.name for item in enum.values if not item.name.endswith("_UNSPECIFIED")]


def _enum_name_of(info: FieldInfo, text: str) -> str:
    """The enum name of a quoted text: itself, or that of a ROS 2 type name."""
    if info.enum.full_name == "joshua.DataType" and "/" in text:
        from joshua.schema import data_types

        package, _, short = text.partition("/")
        name = text if short.startswith("msg/") else f"{package}/msg/{short}"
        if name in data_types.type_names():
            return data_types.enum_names(data_types.number(name))[0]
    return text
