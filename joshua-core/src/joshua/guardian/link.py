"""The driver's side: starts the guardian, sends heartbeats, hands over or dismisses it."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
from typing import Any

from joshua.guardian import standby
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

#: Time for an interpreter to start and import the action, also on a busy small board.
START_TIMEOUT_S = 15.0

#: Room for some seconds of heartbeats. A guardian that has not read for so long does not guard.
SEND_BUFFER_BYTES = 32768

#: Time beyond the order's timeout for a report: a killed action has used it up.
REPORT_MARGIN_S = OVERTIME_S + 2.0


class GuardianError(Exception):
    """The guardian does not start or is gone. The message says why."""


class GuardianLink:
    """A running guardian. If the link closes without ``done``, the guardian acts.

    Args:
        order: what it guards.

    Raises:
        GuardianError: it did not start. Torque must stay off then.
    """

    def __init__(self, order: GuardianOrder) -> None:
        self._order = order
        self._socket, theirs = socket.socketpair()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        program = [sys.executable, "-m", "joshua.guardian.main", str(theirs.fileno()), *sys.path]
        try:
            # A session of its own: no signal of a terminal or a process group reaches it.
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
            raise GuardianError(f"its process cannot be started: {error}") from error
        finally:
            theirs.close()
        self._await_ready(order)

    @property
    def process_id(self) -> int:
        """Process id of the guardian."""
        return self._process.pid

    def armed(self) -> None:
        """Lets the guardian act when this process ends or hangs. Raises GuardianError."""
        self._say(ARMED)

    def beat(self) -> None:
        """Sends a heartbeat without blocking. Raises GuardianError if the guardian is gone."""
        self._say(BEAT)

    def stopping(self) -> None:
        """Announces that the driver applies the safe state itself. Raises GuardianError."""
        self._say(STOPPING)

    def release_only(self) -> None:
        """Makes torque off the safe state. Raises GuardianError."""
        standby.release_only(self._order.node)
        self._say(RELEASE_ONLY)

    def done(self) -> None:
        """Ends the guardian: the safe state is reached. Idempotent."""
        if self._socket.fileno() < 0:
            return
        with contextlib.suppress(GuardianError):
            self._say(DONE)
        self._end()

    def execute(self) -> dict[str, Any]:
        """Lets the guardian apply the safe state and returns its report. The device must be closed.

        Raises:
            GuardianError: no report in time.
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
            self._double(order)
            return
        self._process.kill()
        _, errors = self._process.communicate()
        self._socket.close()
        last = errors.decode(errors="replace").strip().splitlines()[-1:] or [reason]
        raise GuardianError(last[0])

    def _double(self, order: GuardianOrder) -> None:
        """Lets the fork server keep the order, for the case that this process and the guardian both end."""
        try:
            standby.keep(order, self._process.pid)
        except OSError as error:
            self.done()
            raise GuardianError(f"the fork server cannot keep its order: {error}") from error

    def _say(self, word: bytes) -> None:
        try:
            self._socket.send(word)
        except BlockingIOError as error:
            raise GuardianError(
                f"its process {self._process.pid} has not read for some seconds: it hangs or was stopped"
            ) from error
        except OSError as error:
            raise GuardianError(f"its process {self._process.pid} has ended: {error}") from error

    def _end(self) -> None:
        standby.forget(self._order.node)
        self._socket.close()
        if self._process.stderr is not None:
            self._process.stderr.close()
        try:
            self._process.wait(timeout=REPORT_MARGIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()  # told to end, and with nothing left to do
            self._process.wait()
