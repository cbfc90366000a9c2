"""The terminal as a front end: a live table and keys, or plain lines without a terminal."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import termios
from collections.abc import Iterable, Sequence
from typing import Any, TextIO

from joshua.tools import printable, raw

from joshua_calibration.front_end import Ask, Board, FrontEnd, Request
from joshua_calibration.table import board_lines, event_text

_KEYS = {"\n": Ask.CONFIRM, "\r": Ask.CONFIRM, " ": Ask.CONFIRM, "b": Ask.BACK, "q": Ask.QUIT}
_UP, _CLEAR_DOWN, _CLEAR_LINE = "\x1b[{}A", "\x1b[J", "\x1b[K"
_HIDE_CURSOR, _SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"


class TerminalFrontEnd(FrontEnd):
    """Shows a live table on a terminal, and a line for each change elsewhere.

    Keys act at once on a terminal; from a pipe, lines do: an empty line confirms, ``b`` goes back, a number
    repeats that joint, ``q`` quits.
    """

    def __init__(self, keys: TextIO, screen: TextIO) -> None:
        self._screen = screen
        self._is_live = screen.isatty() and os.environ.get("TERM", "dumb") != "dumb"
        self._unicode = (screen.encoding or "").lower().replace("-", "") == "utf8"
        self._keys = _descriptor(keys)
        self._attributes = _without_echo(self._keys)
        self._pending = ""
        self._before: Board | None = None
        self._lines = 0
        if self._is_live:
            self._put(_HIDE_CURSOR)

    @property
    def can_ask(self) -> bool:
        """Whether keys or lines can still arrive."""
        return self._keys >= 0

    def show(self, board: Board) -> None:
        """Redraw the table, or write a line about the change."""
        if not self._is_live:
            text = event_text(self._before, board)
            self._before = board
            if text:
                self._put(f"{printable(text)}\n")
            return
        width = shutil.get_terminal_size().columns - 1
        lines = board_lines(board, width, unicode=self._unicode)
        up = _UP.format(self._lines) if self._lines else ""
        body = "".join(f"{printable(line)}{_CLEAR_LINE}\n" for line in lines)
        self._put(f"{up}\r{body}{_CLEAR_DOWN}")
        self._lines = len(lines)

    def say(self, text: str) -> None:
        """Write a line above the table."""
        up = f"{_UP.format(self._lines)}\r{_CLEAR_DOWN}" if self._lines else ""
        self._lines = 0
        self._put(f"{up}{printable(text)}\n")

    def requests(self) -> Sequence[Request]:
        """Return the requests from keys or lines."""
        text = self._read()
        if self._attributes is not None:
            return list(_requests_of_keys(text))
        *lines, self._pending = (self._pending + text).split("\n")
        return list(_requests_of_lines(lines))

    def close(self) -> None:
        """Restore the terminal."""
        attributes, self._attributes = self._attributes, None
        if attributes is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._keys, termios.TCSADRAIN, attributes)
        if self._is_live:
            self._is_live = False
            self._lines = 0
            self._put(_SHOW_CURSOR)

    def _read(self) -> str:
        if self._keys < 0 or not select.select([self._keys], [], [], 0)[0]:
            return ""
        try:
            data = os.read(self._keys, 1024)
        except OSError:
            data = b""
        if not data:
            self._keys = -1  # end of input: no further requests
        return data.decode(errors="replace")

    def _put(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # the reader is gone; the calibration continues
            raw(self._screen).write(text)
            self._screen.flush()


def _requests_of_keys(text: str) -> Iterable[Request]:
    for key in "" if text.startswith("\x1b") else text:  # ignore arrow keys and the like
        if key in _KEYS:
            yield Request(_KEYS[key])
        elif key in "123456789":
            yield Request(Ask.REPEAT, int(key) - 1)


def _requests_of_lines(lines: Iterable[str]) -> Iterable[Request]:
    for line in lines:
        word = line.strip()
        if word.isdecimal() and word.isascii():
            yield Request(Ask.REPEAT, int(word) - 1)
        elif word in ("", "b", "q"):
            yield Request(_KEYS[word or "\n"])


def _descriptor(stream: TextIO) -> int:
    try:
        return stream.fileno()
    except (OSError, ValueError, AttributeError):
        return -1


def _without_echo(descriptor: int) -> Any:
    """Switch to unbuffered input without echo; Ctrl-C stays a signal. None without a terminal."""
    try:
        attributes = termios.tcgetattr(descriptor)
    except (termios.error, ValueError, OverflowError):
        return None
    changed: list[Any] = [*attributes]
    changed[3] &= ~(termios.ICANON | termios.ECHO)
    termios.tcsetattr(descriptor, termios.TCSADRAIN, changed)
    return attributes
