"""The dialogue of a set-up procedure: in a terminal, or without a person."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType
from typing import Protocol

from joshua.tools import printable

POLL_S = 0.2


class NoAnswer(Exception):
    """No answer: the input has ended, or the request was not fulfilled in time."""


class Dialogue(Protocol):
    """The dialogue with the person who connects the motors."""

    asks: bool
    """Whether a person confirms each step."""

    def say(self, text: str) -> None:
        """Show a text."""

    def wait_for(self, request: str) -> None:
        """Request an action and return when it may be done. Raises NoAnswer."""


class TerminalDialogue:
    """Prints, and waits for the Enter key."""

    asks = True

    def say(self, text: str) -> None:
        """Print a line."""
        sys.stdout.write(printable(text) + "\n")
        sys.stdout.flush()

    def wait_for(self, request: str) -> None:
        """Ask, and wait for Enter. Raises NoAnswer at the end of the input."""
        sys.stdout.write(f"{printable(request)}, then press Enter ")
        sys.stdout.flush()
        if not sys.stdin.readline():
            sys.stdout.write("\n")
            raise NoAnswer(
                "standard input is closed: run the command in a terminal, or add --yes to skip the questions"
            )


class HandsFreeDialogue(TerminalDialogue):
    """Prints, and checks again after a moment instead of asking.

    Args:
        timeout_s: time limit of the same request.
    """

    asks = False

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._request = ""
        self._deadline_s = 0.0

    def wait_for(self, request: str) -> None:
        """Print the request once, and return after a moment. Raises NoAnswer after the time limit."""
        if request != self._request:
            self._request, self._deadline_s = request, time.monotonic() + self._timeout_s
            self.say(f"{request} (waiting for at most {self._timeout_s:g} s)")
        elif time.monotonic() > self._deadline_s:
            raise NoAnswer(f"no motor was found within {self._timeout_s:g} s")
        time.sleep(POLL_S)


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer Ctrl-C until the work inside is finished, then raise KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        del frame
        came.append(number)

    former = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        raise KeyboardInterrupt
