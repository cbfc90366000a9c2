"""Converts literals to values, by the rules of ``google.protobuf.text_format``."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from google.protobuf import text_format

from joshua.textproto.limits import MAX_NUMBER_CHARACTERS

_Value = TypeVar("_Value")
_OCTAL = re.compile(r"^(-?)0(\d+)$")
_ESCAPE = (
    r"\\(?:(?P<letter>[abfnrtv\\'\"])|(?P<octal>[0-7]{1,3})|x(?P<hex>[0-9a-fA-F]{1,2})"
    r"|u(?P<short>[0-9a-fA-F]{4})|U(?P<long>[0-9a-fA-F]{8})|(?P<bad>.|\Z))"
)
_LETTERS = {
    "a": b"\a", "b": b"\b", "f": b"\f", "n": b"\n", "r": b"\r", "t": b"\t", "v": b"\v",
    "\\": b"\\", "'": b"'", '"': b'"',
}  # fmt: skip


class BadEscapeError(ValueError):
    """An escape sequence that is invalid in the text format.

    Attributes:
        offset, length: its position in the literal.
    """

    def __init__(self, message: str, offset: int, length: int) -> None:
        super().__init__(message)
        self.offset = offset
        self.length = length


def integer(text: str) -> int | None:
    """Read a decimal, hexadecimal or octal integer; None if invalid."""
    return plain_integer(_OCTAL.sub(r"\g<1>0o\g<2>", text))


def is_octal(text: str) -> bool:
    """Whether an integer is read as octal and would be another number in decimal."""
    return _OCTAL.match(text) is not None and integer(text) != _parsed(int, text)


def plain_integer(text: str) -> int | None:
    """Read an enum number: an integer that is not octal despite a leading zero."""
    return _parsed(lambda digits: int(digits, 0), text) if len(text) <= MAX_NUMBER_CHARACTERS else None


def number(text: str) -> float | None:
    """Read a floating-point number, ``inf`` or ``nan``; None if invalid."""
    return _parsed(text_format.ParseFloat, text)


def boolean(text: str) -> bool | None:
    """Read a Boolean; None if invalid."""
    return _parsed(text_format.ParseBool, text)


def _parsed(parse: Callable[[str], _Value], text: str) -> _Value | None:
    try:
        return parse(text)
    except ValueError:
        return None


def string_bytes(literal: str) -> bytes:
    """Read a quoted literal, including its quotes.

    Raises:
        BadEscapeError: at the first invalid escape.
    """
    body = literal[1:-1]
    if "\\" not in body:
        return encoded(body)
    result = bytearray()
    at = 0
    for match in re.finditer(_ESCAPE, body):
        result += encoded(body[at : match.start()])
        result += _unescape(match)
        at = match.end()
    result += encoded(body[at:])
    return bytes(result)


def encoded(text: str) -> bytes:
    """Bytes of a text. Invalid bytes of a command line are preserved."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # half of a character, which a command line cannot contain
        return text.encode("utf-8", "surrogatepass")


def _unescape(match: re.Match[str]) -> bytes:
    kind = match.lastgroup
    text = match[kind] if kind is not None else ""
    if kind == "letter":
        return _LETTERS[text]
    if kind == "hex":
        return bytes((int(text, 16),))
    if kind == "octal" and int(text, 8) <= 255:
        return bytes((int(text, 8),))
    if kind == "short" or kind == "long":
        code = int(text, 16)
        # Some of protobuf's parsers read such a backslash as one character, others as the start of an escape.
        if code <= 0x10FFFF and not 0xD800 <= code <= 0xDFFF and chr(code) != "\\":
            return chr(code).encode()
    shown = match[0]
    reasons = {
        "octal": f"{shown} is no byte: the largest is \\377",
        "short": f"{shown} is half of a character: write the character itself or \\U and eight digits",
        "long": f"{shown} is no Unicode character",
    }
    reason = reasons.get(kind or "", f"{shown} is no escape of the text format")
    if kind in ("short", "long") and int(text, 16) == ord("\\"):
        reason = f"{shown} is read in two ways by protobuf's readers: write a backslash as \\\\"
    raise BadEscapeError(reason, match.start() + 1, len(shown))
