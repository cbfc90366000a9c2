"""Restores the terminal if a node that read keys from it could not do so itself."""

from __future__ import annotations

import contextlib
import os
import signal
import termios
from collections.abc import Iterable
from typing import Any

from joshua.plan import NodeSpec, SensorFacts

CONTROLLING_TERMINAL = "/dev/tty"

#: Ends the reports of key releases (the kitty keyboard protocol) and of the window's focus.
RESET_REPORTS = b"\x1b[<u\x1b[?1004l"


class TerminalGuard:
    """Saves the settings of the terminal. Without a terminal it does nothing.

    Args:
        nodes: of the run. If none of them reads the terminal, nothing is done.
    """

    def __init__(self, nodes: Iterable[NodeSpec]) -> None:
        self._descriptor = -1
        self._attributes: list[Any] = []
        if not any(_reads_terminal(node) for node in nodes):
            return
        with contextlib.suppress(OSError, termios.error):
            self._descriptor = os.open(CONTROLLING_TERMINAL, os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
            self._attributes = termios.tcgetattr(self._descriptor)

    def ended(self, nodes: Iterable[NodeSpec]) -> None:
        """Restores the terminal after the end of a process whose nodes read it."""
        if any(_reads_terminal(node) for node in nodes):
            self.restore()

    def restore(self) -> None:
        """Restores changed settings and drops pending input."""
        if not self._attributes:
            return
        with contextlib.suppress(OSError, termios.error):
            if termios.tcgetattr(self._descriptor) == self._attributes:
                return
            # A background process that changes the terminal would be stopped.
            former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
            try:
                os.write(self._descriptor, RESET_REPORTS)
                termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, self._attributes)
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, former)

    def close(self) -> None:
        """Restores and closes the terminal. Idempotent."""
        self.restore()
        self._attributes = []
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _reads_terminal(node: NodeSpec) -> bool:
    return isinstance(node.facts, SensorFacts) and node.facts.terminal
