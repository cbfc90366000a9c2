"""A program in a terminal of its own, as a person has it."""

from __future__ import annotations

import os
import pty
import select
import signal
import termios
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any


class TerminalRun:
    """A program that is the leader of a session on a pseudo-terminal; keys go in, the screen comes out."""

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        self.process_id, self.master = pty.fork()
        if self.process_id == 0:
            os.execve(arguments[0], list(arguments), dict(environment))
        self.text = ""
        self.exit_code: int | None = None
        self.first = self.attributes()

    def attributes(self) -> list[Any]:
        """Settings of the terminal."""
        return termios.tcgetattr(self.master)

    def type(self, keys: str) -> None:
        """Presses keys."""
        os.write(self.master, keys.encode())

    def look(self, timeout_s: float = 0.05) -> bool:
        """Takes what came onto the screen; False when the program has ended."""
        if not select.select([self.master], [], [], timeout_s)[0]:
            return True
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return False
        self.text += data.decode(errors="replace")
        return bool(data)

    def wait(self, condition: Callable[[], object], what: str, keys: str = "") -> None:
        """Waits for something, and presses keys meanwhile, as a held key does."""
        deadline_s = time.monotonic() + 60
        while not condition():
            assert time.monotonic() < deadline_s, f"{what} did not come:\n{self.text}"
            if keys:
                self.type(keys)
            self.look(0.03)

    def wait_for(self, *texts: str) -> None:
        """Waits for texts on the screen, in whatever order, and forgets all up to the end of the last one."""
        self.wait(lambda: all(text in self.text for text in texts), " and ".join(map(repr, texts)))
        self.text = self.text[max(self.text.index(text) + len(text) for text in texts) :]

    def end(self) -> int:
        """Waits for the end of the program; returns its exit code."""
        deadline_s = time.monotonic() + 60
        while self.exit_code is None:
            assert time.monotonic() < deadline_s, self.text
            self.look()
            done, status = os.waitpid(self.process_id, os.WNOHANG)
            if done:
                self.exit_code = os.waitstatus_to_exitcode(status)
        while self.look(0.05) and select.select([self.master], [], [], 0)[0]:
            pass
        return self.exit_code

    def hang_up(self) -> None:
        """Closes the terminal, as its window or a broken connection does, and waits for the end."""
        os.close(self.master)
        self.master = -1
        deadline_s = time.monotonic() + 60
        while not os.waitpid(self.process_id, os.WNOHANG)[0]:
            assert time.monotonic() < deadline_s, "the program goes on without its terminal"
            time.sleep(0.02)
        self.exit_code = -signal.SIGHUP

    def close(self) -> None:
        """Kills the program if it still runs, and closes the terminal."""
        if self.exit_code is None:
            os.kill(self.process_id, signal.SIGKILL)
            os.waitpid(self.process_id, 0)
            self.exit_code = -signal.SIGKILL
        if self.master >= 0:
            os.close(self.master)
