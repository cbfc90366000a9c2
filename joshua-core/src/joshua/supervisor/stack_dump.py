"""Where a hung process hangs, from the stacks that it writes to standard error when it is asked."""

from __future__ import annotations

import re

_FRAME = re.compile(r'^  File "(?P<file>.*)", line (?P<line>\d+) in (?P<function>.*)$')


class StackDump:
    """Takes lines of standard error and picks out the stacks of ``faulthandler``."""

    def __init__(self) -> None:
        self.place = ""
        self._current = False

    def take(self, line: str) -> bool:
        """Takes a line; returns whether it belongs to the stacks.

        ``place`` becomes the innermost frame of the thread that the signal met, usually the main thread.
        """
        frame = _FRAME.match(line)
        if frame is not None:
            if self._current and not self.place:
                self.place = f"{frame['function']} ({frame['file']}:{frame['line']})"
            return True
        self._current = line.startswith("Current thread 0x")
        return self._current or line.startswith("Thread 0x") or not line
