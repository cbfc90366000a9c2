"""The driver as its guardian sees it: whether it lives, and its end."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import time

#: The end of a killed process is waited for so long; a device call may hold it in the kernel.
END_TIMEOUT_S = 1.0

_POLL_S = 0.002


class DriverProcess:
    """A process that is this one's parent when it is made.

    A process descriptor never names another process, unlike a number that was given away again; where
    the system has none, the parent's number is compared before each use.
    """

    def __init__(self, process_id: int) -> None:
        self.process_id = process_id
        self._descriptor = -1
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                self._descriptor = os.pidfd_open(process_id)

    @property
    def alive(self) -> bool:
        """Whether the process has not ended yet."""
        if self._descriptor >= 0:
            return not select.select([self._descriptor], [], [], 0)[0]
        return os.getppid() == self.process_id

    def kill(self) -> bool:
        """Kills the process if it lives and waits for its end; returns whether it has ended."""
        deadline_s = time.monotonic() + END_TIMEOUT_S
        if self.alive:
            with contextlib.suppress(ProcessLookupError):
                if self._descriptor >= 0 and sys.platform == "linux":
                    signal.pidfd_send_signal(self._descriptor, signal.SIGKILL)
                else:
                    os.kill(self.process_id, signal.SIGKILL)
        while self.alive and time.monotonic() < deadline_s:
            time.sleep(_POLL_S)
        return not self.alive
