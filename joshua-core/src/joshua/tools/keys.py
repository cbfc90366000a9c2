"""Commands that show a screen and act on single keys."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping

from joshua.cli.exit_codes import ExitCode
from joshua.ipc.client import CallError
from joshua.plan.foreign_text import printable, raw

#: Interval at which the screen is drawn again, s.
_REDRAW_S = 0.5

#: Keys that leave the screen: q, and Ctrl-D or the end of the input.
_LEAVE = ("q", "\x04")


def key_screen(
    command: str, screen: Callable[[int], str], keys: Mapping[str, Callable[[], str]], help_text: str
) -> ExitCode:
    """Show a screen and act on keys until q or Ctrl-D. Below it stands the answer to the last key.

    Args:
        command: with an action that needs no keys, such as ``record start``, for messages.
        screen: returns the lines for a width; keys: what each key does, which returns its answer.
        help_text: names the keys.

    Raises:
        CallError: the system has ended. Any other one that an action raises is its answer.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        name = command.partition(" ")[0]
        sys.stderr.write(f"joshua {name}: keys need a terminal: name an action, such as `joshua {command}`\n")
        return ExitCode.INVALID
    said = ""
    with _single_keys() as key:
        while True:
            shown = screen(shutil.get_terminal_size().columns)
            text = printable(f"{shown}\n\n{help_text}\n{said}\n")
            raw(sys.stdout).write(f"\x1b[H\x1b[J{text}")
            sys.stdout.flush()
            pressed = key(_REDRAW_S)
            if pressed in _LEAVE:
                return ExitCode.OK
            if pressed not in keys:
                continue
            try:
                said = keys[pressed]()
            except CallError as error:
                if error.code in ("unreachable", "gone"):
                    raise
                said = str(error)


@contextlib.contextmanager
def _single_keys() -> Iterator[Callable[[float], str]]:
    """Read keys without Return; the terminal is restored at the end.

    Yields:
        A function that waits for so many seconds at most, and returns a key, "" for none.
    """
    import termios
    import tty

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)

    def key(wait_s: float) -> str:
        until = time.monotonic() + wait_s
        while (left := until - time.monotonic()) > 0:
            if select.select([terminal], [], [], left)[0]:
                # not by sys.stdin, whose buffer hides further keys from select
                data = os.read(terminal, 1)
                return data.decode(errors="replace") if data else _LEAVE[-1]
        return ""

    try:
        tty.setcbreak(terminal)
        yield key
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
