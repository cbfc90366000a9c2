"""The terminal that the run was started from, as a source of keys.

The run's output continues: only input changes, and the terminal still handles Ctrl-C. The parent process
restores the settings if this process dies.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import termios
from typing import Any

from joshua.api import DeviceDisconnected

from joshua_teleop_input.errors import InputDeviceError

CONTROLLING_TERMINAL = "/dev/tty"

#: Query whether the terminal supports the kitty keyboard protocol.
_QUERY = b"\x1b[?u"

#: Report key releases and repetitions, all keys as sequences, shifted characters, and loss of focus.
_ON = b"\x1b[>15u\x1b[?1004h"
_OFF = b"\x1b[<u\x1b[?1004l"

_LFLAG, _IFLAG, _CC = 3, 0, 6


class KeyTerminal:
    """The controlling terminal, read key by key."""

    def __init__(self) -> None:
        self._descriptor = -1
        self._attributes: list[Any] = []
        self._ours: list[Any] = []
        self._reports = False

    def open(self) -> None:
        """Read keys without echo. Raises InputDeviceError."""
        try:
            self._descriptor = os.open(CONTROLLING_TERMINAL, os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
        except OSError as error:
            raise InputDeviceError(
                "there is no terminal to read keys from: this run was started by a service, a scheduler or "
                "another program; start joshua in a terminal (over SSH: ssh -t), or drive with a gamepad "
                f"({CONTROLLING_TERMINAL}: {(error.strerror or '').lower()})"
            ) from error
        try:
            self._take()
        except BaseException:
            self.close()
            raise

    def report_releases(self) -> None:
        """Make the terminal report key releases, after it has confirmed support."""
        if not self._reports:
            self._reports = True
            os.write(self._descriptor, _ON)

    def read(self, timeout_s: float) -> bytes:
        """Wait for bytes; b"" if none arrived. Raises DeviceDisconnected."""
        ready, _, _ = select.select([self._descriptor], [], [], timeout_s)
        if not ready:
            return b""
        try:
            data = os.read(self._descriptor, 1024)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise DeviceDisconnected("the terminal was closed or disconnected") from error
        if not data:
            raise DeviceDisconnected("the terminal was closed or disconnected")
        return data

    def interrupt(self) -> None:
        """Send the interrupt that the terminal sends at Ctrl-C in its normal mode."""
        os.killpg(os.tcgetpgrp(self._descriptor), signal.SIGINT)

    def close(self) -> None:
        """Restore the terminal. Idempotent."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor < 0:
            return
        with contextlib.suppress(OSError, termios.error):
            if self._reports:
                os.write(descriptor, _OFF)
            # After the run was killed, a shell may already have configured the terminal for itself.
            if self._attributes and termios.tcgetattr(descriptor) == self._ours:
                _set_attributes(descriptor, self._attributes)
        os.close(descriptor)
        self._attributes, self._reports = [], False

    def _take(self) -> None:
        if os.tcgetpgrp(self._descriptor) != os.getpgrp():
            raise InputDeviceError(
                "this run is in the background of its terminal, whose keys go to another program: bring it "
                "to the foreground (fg), or start it without &"
            )
        self._attributes = termios.tcgetattr(self._descriptor)
        changed = termios.tcgetattr(self._descriptor)
        changed[_LFLAG] &= ~(termios.ICANON | termios.ECHO | termios.IEXTEN)
        changed[_IFLAG] &= ~termios.IXON
        changed[_CC][termios.VMIN], changed[_CC][termios.VTIME] = 1, 0
        # Suspending the run would leave an arm energised without an operator.
        changed[_CC][termios.VSUSP] = os.fpathconf(self._descriptor, "PC_VDISABLE").to_bytes(1, "little")
        _set_attributes(self._descriptor, changed)
        self._ours = termios.tcgetattr(self._descriptor)
        os.write(self._descriptor, _QUERY)


def _set_attributes(descriptor: int, attributes: list[Any]) -> None:
    """Change the terminal settings; unread characters are dropped."""
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
    try:
        termios.tcsetattr(descriptor, termios.TCSAFLUSH, attributes)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)
