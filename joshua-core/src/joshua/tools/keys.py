"""Single keys from a terminal, for commands that show a screen."""

from __future__ import annotations

import contextlib
import select
import sys
import time
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def single_keys() -> Iterator[Callable[[float], str]]:
    """Read keys without Return; the terminal is restored at the end.

    Yields:
        A function that waits for so many seconds at most, and returns a key, "" for none.
    """
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)

    def key(wait_s: float) -> str:
        until = time.monotonic() + wait_s
        while (left := until - time.monotonic()) > 0:
            if select.select([sys.stdin], [], [], left)[0]:
                return sys.stdin.read(1)
        return ""

    try:
        tty.setcbreak(sys.stdin)
        yield key
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
