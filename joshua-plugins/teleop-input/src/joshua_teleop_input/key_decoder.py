"""Decoder of terminal input: plain characters, escape sequences, and the kitty keyboard protocol."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from joshua_teleop_input.keys import canonical_key

_ESCAPE = 0x1B
_LONGEST_SEQUENCE = 64

_LETTERS = {
    **{"A": "up", "B": "down", "C": "right", "D": "left", "H": "home", "F": "end", "Z": "tab"},
    **{"P": "f1", "Q": "f2", "R": "f3", "S": "f4"},
}
_TILDE = {
    **{1: "home", 2: "insert", 3: "delete", 4: "end", 5: "page_up", 6: "page_down", 7: "home", 8: "end"},
    **{11: "f1", 12: "f2", 13: "f3", 14: "f4", 15: "f5", 17: "f6", 18: "f7", 19: "f8", 20: "f9", 21: "f10"},
    **{23: "f11", 24: "f12"},
}
_CONTROL = {9: "tab", 10: "enter", 13: "enter", 8: "backspace", 127: "backspace", 27: "escape", 32: "space"}

#: The keypad in the kitty keyboard protocol: digits, signs, arrows.
_KEYPAD = {
    **{57399 + digit: str(digit) for digit in range(10)},
    **{57409: ".", 57410: "/", 57411: "*", 57412: "-", 57413: "+", 57414: "enter", 57415: "="},
    **{57417: "left", 57418: "right", 57419: "up", 57420: "down", 57421: "page_up", 57422: "page_down"},
    **{57423: "home", 57424: "end", 57425: "insert", 57426: "delete"},
}

_SHIFT, _CTRL = 1, 4
_COMMANDS = 2 | 4 | 8 | 16 | 32  # alt, ctrl, super, hyper, meta


class Kind(Enum):
    """What happened."""

    PRESS = 1
    REPEAT = 2
    RELEASE = 3
    INTERRUPT = 4
    """Ctrl-C, if the terminal reports it as a key."""
    FOCUS_LOST = 5
    REPORTS_RELEASES = 6
    """The terminal reports that it supports the kitty keyboard protocol."""


@dataclass(frozen=True)
class KeyEvent:
    """One event; ``key`` is a canonical name, ``identity`` names the key independent of Shift."""

    kind: Kind
    key: str = ""
    identity: str = ""


class KeyDecoder:
    """Splits a byte stream into events; an incomplete sequence waits for the rest."""

    def __init__(self) -> None:
        self._rest = b""

    @property
    def waiting(self) -> bool:
        """Whether an incomplete sequence is waiting."""
        return bool(self._rest)

    def feed(self, data: bytes) -> list[KeyEvent]:
        """Add bytes; return the events that they complete."""
        data = self._rest + data
        events: list[KeyEvent] = []
        while data:
            used, found = _next(data)
            if used == 0:
                break
            events += found
            data = data[used:]
        self._rest = data
        return events

    def flush(self) -> list[KeyEvent]:
        """Return the Escape key: no bytes followed a waiting escape character."""
        rest, self._rest = self._rest, b""
        return [KeyEvent(Kind.PRESS, "escape", "escape")] if rest == b"\x1b" else []


def _next(data: bytes) -> tuple[int, list[KeyEvent]]:
    """Return the bytes used by the first event, 0 if more are needed, and the event."""
    if data[0] != _ESCAPE:
        return _character(data)
    if len(data) == 1:
        return 0, []
    if data[1:2] == b"O":
        if len(data) == 2:
            return 0, []
        return 3, _press(_LETTERS.get(chr(data[2])))
    if data[1:2] != b"[":
        return 1, [KeyEvent(Kind.PRESS, "escape", "escape")]
    for index in range(2, len(data)):
        byte = data[index]
        if 0x40 <= byte <= 0x7E:
            return index + 1, _sequence(data[2:index].decode("ascii"), chr(byte))
        if not 0x20 <= byte <= 0x3F or index > _LONGEST_SEQUENCE:
            return index, []
    return 0, []


def _character(data: bytes) -> tuple[int, list[KeyEvent]]:
    first = data[0]
    if first < 0x80:
        name = _CONTROL.get(first) or (chr(first) if first > 0x20 else None)
        return 1, _press(name)
    length = 2 if first >> 5 == 0b110 else 3 if first >> 4 == 0b1110 else 4 if first >> 3 == 0b11110 else 0
    if not length:
        return 1, []
    if len(data) < length:
        return (0, []) if all(byte >> 6 == 0b10 for byte in data[1:]) else (1, [])
    try:
        return length, _press(data[:length].decode())
    except UnicodeDecodeError:
        return 1, []


def _press(name: str | None) -> list[KeyEvent]:
    key = canonical_key(name) if name else None
    return [KeyEvent(Kind.PRESS, key, key)] if key else []


def _sequence(parameters: str, final: str) -> list[KeyEvent]:
    if parameters.startswith("?"):
        return [KeyEvent(Kind.REPORTS_RELEASES)] if final == "u" else []
    if not parameters and final in "IO":
        return [KeyEvent(Kind.FOCUS_LOST)] if final == "O" else []
    try:
        fields = [[int(part or 0) for part in field.split(":")] for field in parameters.split(";")]
    except ValueError:
        return []
    codes = fields[0]
    modifiers = max(0, fields[1][0] - 1) if len(fields) > 1 else 0
    number = fields[1][1] if len(fields) > 1 and len(fields[1]) > 1 else 1
    kind = Kind(number) if number in (1, 2, 3) else Kind.PRESS
    if final == "u":
        return _kitty_key(codes, modifiers, kind)
    name = _TILDE.get(codes[0]) if final == "~" else _LETTERS.get(final)
    return _event(kind, name, name, modifiers)


def _kitty_key(codes: list[int], modifiers: int, kind: Kind) -> list[KeyEvent]:
    base = _name(codes[0])
    if base == "c" and modifiers & _CTRL and kind is not Kind.RELEASE:
        return [KeyEvent(Kind.INTERRUPT)]
    shifted = _name(codes[1]) if modifiers & _SHIFT and len(codes) > 1 and codes[1] else base
    return _event(kind, shifted, base, modifiers)


def _name(code: int) -> str | None:
    if code in _CONTROL or code in _KEYPAD:
        return _CONTROL.get(code) or _KEYPAD[code]
    if not 0x20 < code < 0xE000:  # the rest are modifiers and media keys
        return None
    return canonical_key(chr(code)) if not code >= 0xD800 else None


def _event(kind: Kind, name: str | None, identity: str | None, modifiers: int) -> list[KeyEvent]:
    if name is None or identity is None:
        return []
    if modifiers & _COMMANDS and kind is not Kind.RELEASE:
        return []  # shortcuts have no effect
    return [KeyEvent(kind, name, identity)]
