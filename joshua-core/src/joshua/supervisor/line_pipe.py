"""What a child writes to its standard streams, cut into lines; a flood costs next to nothing."""

from __future__ import annotations

import os
from collections.abc import Callable

from joshua.ipc.line_budget import LineBudget

#: Bytes kept of one line.
MAX_LINE_BYTES = 4096

READ_BYTES = 65536


class LinePipe:
    """The reading end of one standard stream; never blocks.

    Args:
        descriptor: reading end of a pipe; this object owns it from now on.
        budget: lines that may pass; shared by the streams of a process.
        on_line: called with each line, without its end.
        on_dropped: called with the number of lines that were dropped before the next one.
        on_flood: called whenever lines are dropped.
    """

    def __init__(
        self,
        descriptor: int,
        budget: LineBudget,
        on_line: Callable[[str], None],
        on_dropped: Callable[[int], None],
        on_flood: Callable[[], None],
    ) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor = descriptor
        self._budget = budget
        self._on_line = on_line
        self._on_dropped = on_dropped
        self._on_flood = on_flood
        self._partial = b""
        self._cut_bytes = 0

    def read(self) -> bool:
        """Reads once, a bounded amount; returns False at the end of the stream."""
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if not data:
            self._finish_line()
            return False
        self._split(data)
        return True

    def drain(self) -> None:
        """Reads what is there, at the end of the child; a grandchild that writes on is not waited for."""
        for _ in range(64):
            try:
                data = os.read(self.descriptor, READ_BYTES)
            except OSError:
                break
            if not data:
                break
            self._split(data)
        self._finish_line()

    def close(self) -> None:
        """Closes the pipe; a second call does nothing."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1

    def _split(self, data: bytes) -> None:
        if self._budget.exhausted:
            # Only the line ends matter, and counting them is fast.
            lines = data.count(b"\n")
            self._budget.drop(lines)
            self._on_flood()
            if lines:
                self._partial, self._cut_bytes = data[data.rfind(b"\n") + 1 :][:MAX_LINE_BYTES], 0
            return
        *complete, rest = data.split(b"\n")
        for part in complete:
            self._extend(part)
            self._finish_line(always=True)
        self._extend(rest)

    def _extend(self, part: bytes) -> None:
        room = MAX_LINE_BYTES - len(self._partial)
        self._partial += part[:room]
        self._cut_bytes += max(0, len(part) - room)

    def _finish_line(self, *, always: bool = False) -> None:
        line, cut_bytes = self._partial, self._cut_bytes
        self._partial, self._cut_bytes = b"", 0
        if not line and not always:
            return
        allowed, dropped = self._budget.take()
        if dropped:
            self._on_dropped(dropped)
        if allowed:
            text = line.decode("utf-8", "backslashreplace").rstrip("\r")
            self._on_line(text + (f" … ({cut_bytes} more bytes)" if cut_bytes else ""))
