"""Takes a port over from the guardian of a failed driver."""

from __future__ import annotations

import time
from collections.abc import Callable

from joshua.api import Cancelled
from joshua_serial.errors import PortBusy, PortGuarded
from joshua_serial.port import SerialPort

POLL_S = 0.05

#: A node that is not ready after 20 s is ended, and reports what it waited for.
PATIENCE_S = 15.0


def open_unguarded(port: SerialPort, stopping: Callable[[], bool]) -> None:
    """Open a port as soon as no guardian uses it. Raises what opening raises, and Cancelled."""
    deadline_s = time.monotonic() + PATIENCE_S
    was_guarded = False
    while True:
        try:
            port.open()
        except PortBusy as error:
            was_guarded |= isinstance(error, PortGuarded)  # an ending one looks like any other
            if not was_guarded:
                raise
            if stopping():
                raise Cancelled from None
            if time.monotonic() > deadline_s:
                raise
            time.sleep(POLL_S)
        else:
            return
