"""The driver's side: starts the guardian, shows signs of life, hands over or says that all is done."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
from typing import Any

from joshua.guardian.order import (
    ARMED,
    BEAT,
    DONE,
    EXECUTE,
    OVERTIME_S,
    READY,
    RELEASE_ONLY,
    STOPPING,
    GuardianOrder,
)

#: An interpreter must start and import the action within this time, also on a busy small board.
START_TIMEOUT_S = 15.0

#: Room for some seconds of beats: a guardian that has not listened for so long does not guard.
SEND_BUFFER_BYTES = 32768

#: Time beyond the order's own in which a report must come, which an action that is given up has overdrawn.
REPORT_MARGIN_S = OVERTIME_S + 2.0


class GuardianError(Exception):
    """The guardian does not start, or is gone; the message says why."""


class GuardianLink:
    """A guardian that runs. Closing the link without ``done`` makes it act.

    Args:
        order: what it guards.

    Raises:
        GuardianError: it did not start; nothing may be energised then.
    """

    def __init__(self, order: GuardianOrder) -> None:
        self._order = order
        self._socket, theirs = socket.socketpair()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        program = [sys.executable, "-m", "joshua.guardian.main", "--descriptor", str(theirs.fileno())]
        for entry in sys.path:
            program += ["--path", entry]
        try:
            # A session of its own, so that neither a terminal nor a group's signal reaches it.
            self._process = subprocess.Popen(
                program,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        except OSError as error:
            self._socket.close()
            raise GuardianError(f"the system refuses to start its process: {error}") from error
        finally:
            theirs.close()
        self._await_ready(order)

    @property
    def process_id(self) -> int:
        """Of the guardian."""
        return self._process.pid

    def armed(self) -> None:
        """From now on the guardian acts when this process ends or falls silent. Raises GuardianError."""
        self._say(ARMED)

    def beat(self) -> None:
        """Shows a sign of life; never blocks. Raises GuardianError if nobody guards any more."""
        self._say(BEAT)

    def stopping(self) -> None:
        """Says that the driver now applies the safe state itself. Raises GuardianError."""
        self._say(STOPPING)

    def release_only(self) -> None:
        """Says that the joints must lose their torque, whatever their safe state is. Raises GuardianError."""
        self._say(RELEASE_ONLY)

    def done(self) -> None:
        """Ends the guardian: the safe state stands. A second call does nothing."""
        if self._socket.fileno() < 0:
            return
        with contextlib.suppress(GuardianError):
            self._say(DONE)
        self._end()

    def execute(self) -> dict[str, Any]:
        """Lets the guardian apply the safe state; the device must be closed. Returns its report.

        Raises:
            GuardianError: no report came in time.
        """
        self._say(EXECUTE)
        self._socket.settimeout(self._order.timeout_s + REPORT_MARGIN_S)
        try:
            with self._socket.makefile("rb") as lines:
                report = json.loads(lines.readline())
        except (OSError, ValueError) as error:
            raise GuardianError(f"it sent no report: {error}") from error
        self._end()
        return dict(report)

    def _await_ready(self, order: GuardianOrder) -> None:
        try:
            self._socket.settimeout(START_TIMEOUT_S)
            self._socket.sendall(order.to_line())
            answer = self._socket.recv(len(READY), socket.MSG_WAITALL)
        except OSError as error:
            answer, reason = b"", f"it is not ready after {START_TIMEOUT_S:g} s: {error}"
        else:
            reason = "it ended at once"
        if answer == READY:
            self._socket.setblocking(False)
            return
        self._process.kill()
        _, errors = self._process.communicate()
        self._socket.close()
        last = errors.decode(errors="replace").strip().splitlines()[-1:] or [reason]
        raise GuardianError(last[0])

    def _say(self, word: bytes) -> None:
        try:
            self._socket.send(word)
        except BlockingIOError as error:
            raise GuardianError(
                f"its process {self._process.pid} has not listened for some seconds: it hangs or was stopped"
            ) from error
        except OSError as error:
            raise GuardianError(f"its process {self._process.pid} has ended: {error}") from error

    def _end(self) -> None:
        self._socket.close()
        if self._process.stderr is not None:
            self._process.stderr.close()
        try:
            self._process.wait(timeout=REPORT_MARGIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()  # told to end, and holding nothing: it must not stay
            self._process.wait()
