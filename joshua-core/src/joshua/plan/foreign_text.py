"""Text from files, devices, the network and libraries, made safe before a terminal or a log gets it.

There is one function, ``printable``: control characters become visible, and known secrets are masked.
Whatever becomes a log line, a message or an answer passes it, and the standard streams of ``joshua`` apply it
to all that is written. Only what draws on a terminal writes to ``raw``; it cleans the text that it draws.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any, TextIO

#: What stands for a secret.
HIDDEN = "(hidden)"

#: Control characters but tab and line feed, and what changes the direction of text.
_ESCAPES = {code: f"\\x{code:02x}" for code in (*range(9), *range(11, 32), *range(127, 160))}
_ESCAPES |= {code: f"\\u{code:04x}" for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A))}

#: Parts of the names of environment variables whose values are secrets.
_NAME_PARTS = ("TOKEN", "SECRET", "PASSWORD", "PASSWD", "PASSPHRASE", "CREDENTIAL", "KEY")
_NAMES = (
    r"(TOKEN|SECRET|PASSWORD|PASSWD|PASSPHRASE|CREDENTIAL|(ACCESS|API|PRIVATE|SECRET|ENCRYPTION)_?KEY)S?(_|$)"
)

#: Shortest value that is masked anywhere; shorter ones, from 4 characters, only as a whole word.
_LONG_SECRET, _SHORT_SECRET = 8, 4

#: Values that are switches, not secrets.
_SWITCHES = ("true", "false", "none", "null", "auto", "default")

#: What a text with a password or token contains, and the patterns that find it there.
_MARKS = ("://", "hf_", "AKIA", "ASIA", "ya29.", "gh", "AIza", "earer ", "asic ", "sk-", "xox", "glpat-")
_TOKENS = (
    r"\bhf_[A-Za-z0-9]{8,}|\b(?:AKIA|ASIA)[A-Z0-9]{12,}|ya29\.[\w.-]{8,}|\bgh[pousr]_\w{16,}|AIza[\w-]{20,}"
    r"|\bsk-[A-Za-z0-9_-]{20,}|\bxox[abprs]-[\w-]{10,}|\bglpat-[\w-]{10,}"
)
_USER = r"(?<=://)[^/\s@:]*:[^/\s@]*(?=@)"
_PARAMETER = r"([?&][^=&\s'\"]*(?:token|secret|password|key|sig|signature|credential)[^=&\s'\"]*=)[^&\s'\"]+"
_HEADER = r"\b(Bearer|Basic)\s+[\w.~+/=-]{6,}"


def printable(text: str, limit: int = 0) -> str:
    """Return foreign text for JSON, logs and terminals.

    Escapes lone surrogates, bidirectional controls, and control characters except tab and line feed, and
    masks secrets as ``masked`` does.

    Args:
        limit: characters that are kept, 0 for all.
    """
    text = masked(text)
    if limit and len(text) > limit:
        text = f"{text[:limit]}… ({len(text) - limit} more characters)"
    if text.isascii() and text.isprintable():
        return text
    return text.translate(_ESCAPES).encode("utf-8", "backslashreplace").decode("utf-8")


def masked(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Remove secrets from a text: values of secret variables, tokens of known forms, passwords in addresses.

    Args:
        environment: with the variables; None for that of this process.
    """
    for value in _secrets(os.environ if environment is None else environment):
        if value in text:
            if len(value) >= _LONG_SECRET:
                text = text.replace(value, HIDDEN)
            else:
                text = re.sub(rf"(?<!\w){re.escape(value)}(?!\w)", HIDDEN, text)
    if not any(mark in text for mark in _MARKS):
        return text
    text = _pattern(_USER).sub(HIDDEN, text)
    text = _pattern(_TOKENS).sub(HIDDEN, text)
    text = _pattern(_PARAMETER).sub(rf"\1{HIDDEN}", text)
    return _pattern(_HEADER).sub(rf"\1 {HIDDEN}", text)


def has_token(text: str) -> bool:
    """Return whether a text contains a token of a known form, or an address with a password."""
    return bool(_pattern(_USER).search(text) or _pattern(_TOKENS).search(text))


class _ChangedStream:
    """A standard stream that changes all text before it writes it.

    Args:
        stream: that it writes to; change: returns what is written in place of a text.
    """

    def __init__(self, stream: TextIO, change: Callable[[str], str]) -> None:
        self._stream = stream
        self._change = change

    def write(self, text: str) -> int:
        """Write a text. Returns its length."""
        self._stream.write(self._change(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts, which have their line ends."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def __iter__(self) -> Any:
        return iter(self._stream)


class SafeStream(_ChangedStream):
    """A standard stream that makes all text printable.

    Args:
        stream: that it writes to.

    Attributes:
        raw: the same stream for terminal control sequences; secrets are masked there, too.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream, printable)
        self.raw = _ChangedStream(stream, masked)


def raw(stream: TextIO) -> TextIO:
    """Return the stream for terminal control sequences and text that is printable already."""
    found: TextIO = getattr(stream, "raw", stream)
    return found


def _secrets(environment: Mapping[str, str]) -> list[str]:
    found = []
    for name, value in environment.items():
        upper = name.upper()
        if not any(part in upper for part in _NAME_PARTS):
            continue
        is_path = value.startswith(("/", "~", "."))
        if is_path or len(value) < _SHORT_SECRET or value.lower() in _SWITCHES or value.isdecimal():
            continue
        if _pattern(_NAMES).search(upper) or upper.endswith(("PASSWORD", "TOKEN")):
            found.append(value)
    return sorted(found, key=len, reverse=True)


@cache
def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE if text in (_HEADER, _PARAMETER) else 0)
