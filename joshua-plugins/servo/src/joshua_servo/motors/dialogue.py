"""What a set-up procedure says and asks; the terminal's one and the one without a person."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType
from typing import Protocol

from joshua.tools import clean

POLL_S = 0.2


class NoAnswer(Exception):
    """Nobody answers: the input has ended, or what was asked for did not come in time."""


class Dialogue(Protocol):
    """How a procedure talks to whoever connects the motors."""

    asks: bool
    """Whether a person says when to go on."""

    def say(self, text: str) -> None:
        """Tell something."""

    def wait_for(self, request: str) -> None:
        """Ask for something to be done and return when it may have been. Raises NoAnswer."""


class TerminalDialogue:
    """Prints, and waits for the Enter key."""

    asks = True

    def say(self, text: str) -> None:
        """Print a line."""
        sys.stdout.write(clean(text) + "\n")
        sys.stdout.flush()

    def wait_for(self, request: str) -> None:
        """Ask, and wait for Enter. Raises NoAnswer at the end of the input."""
        sys.stdout.write(f"{clean(request)}, then press Enter ")
        sys.stdout.flush()
        if not sys.stdin.readline():
            sys.stdout.write("\n")
            raise NoAnswer("the input has ended: run it in a terminal, or add --yes to skip the questions")


class HandsFreeDialogue(TerminalDialogue):
    """Prints, and looks again after a moment instead of asking.

    Args:
        timeout_s: how long the same request may stay without effect.
    """

    asks = False

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._request = ""
        self._deadline_s = 0.0

    def wait_for(self, request: str) -> None:
        """Say what is waited for, once; return after a moment. Raises NoAnswer when it takes too long."""
        if request != self._request:
            self._request, self._deadline_s = request, time.monotonic() + self._timeout_s
            self.say(f"{request} (waiting for at most {self._timeout_s:g} s)")
        elif time.monotonic() > self._deadline_s:
            raise NoAnswer(f"no motor was found within {self._timeout_s:g} s")
        time.sleep(POLL_S)


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let a piece of work finish when Ctrl-C comes meanwhile; raise KeyboardInterrupt after it."""
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
