"""A run in the terminal: start-up table, log lines, live status, end-of-run table."""

from __future__ import annotations

import os
import shutil
import sys
import time
from typing import TextIO

from joshua.plan import RunReport
from joshua.plan.events import Event, LogEntry, RunStatus, StartTable
from joshua.plan.foreign_text import raw
from joshua.supervisor.log_files import BackgroundWriter
from joshua.supervisor.tables import Screen, log_line, report_lines, start_lines, status_lines

#: Time between two status lines if the output is not a terminal.
PLAIN_STATUS_PERIOD_S = 10.0

#: Time limit for writing the last lines.
CLOSE_TIMEOUT_S = 2.0

_STYLES = {"WARNING": "33", "ERROR": "31", "CRITICAL": "31;1", "DEBUG": "2"}


class Terminal:
    """Show a run as text; a terminal that blocks delays nothing else.

    Args:
        log_level: lowest level of the log lines shown, as in ``logging``.
        output: table, status and report; errors: log lines.
    """

    def __init__(self, log_level: int, output: TextIO | None = None, errors: TextIO | None = None) -> None:
        self._log_level = log_level
        self._output = output or sys.stdout
        self._errors = errors or sys.stderr
        self._live = self._output.isatty() and os.environ.get("TERM") != "dumb"
        self._status: list[str] = []
        self._plain_due_s = 0.0
        self._writer = BackgroundWriter[tuple[TextIO, str]](self._write, "terminal")

    def __call__(self, event: Event) -> None:
        """Show an event. The others appear in the log."""
        if isinstance(event, StartTable):
            self._on_table(event)
        elif isinstance(event, RunStatus):
            self._on_status(event)
        elif isinstance(event, LogEntry):
            self._on_log(event)
        elif isinstance(event, RunReport):
            self._on_finish(event)

    def _on_table(self, table: StartTable) -> None:
        self._plain_due_s = time.monotonic() + PLAIN_STATUS_PERIOD_S
        self._put(self._output, "\n".join(start_lines(table, Screen.of(self._output))) + "\n")

    def _on_status(self, status: RunStatus) -> None:
        """Update the status in place, or print it periodically without a terminal."""
        if self._live:
            clear = self._clear() or "\r\x1b[K"
            rows = shutil.get_terminal_size().lines
            self._status = status_lines(status, Screen.of(self._output))[: max(rows - 1, 1)]
            self._writer.put((self._output, clear + "\n".join(self._status)))
        elif status.phase == "running" and time.monotonic() >= self._plain_due_s:
            self._plain_due_s = time.monotonic() + PLAIN_STATUS_PERIOD_S
            self._writer.put((self._output, "\n".join(status_lines(status)) + "\n"))

    def _on_log(self, entry: LogEntry) -> None:
        """Show a log line of sufficient level."""
        if entry.level < self._log_level:
            return
        screen, style = Screen.of(self._errors), _STYLES.get(entry.level_name, "")
        self._put(self._errors, screen.paint(log_line(entry, screen), style) + "\n")

    def _on_finish(self, report: RunReport) -> None:
        """Show the end-of-run table and write pending output."""
        clear, self._status = self._clear(), []
        if clear:
            self._writer.put((self._output, clear))
        self._put(self._output, "\n".join(report_lines(report, Screen.of(self._output))) + "\n")
        self._writer.close(CLOSE_TIMEOUT_S)

    def _clear(self) -> str:
        """The sequence that removes the status from the terminal; "" if none is shown."""
        if not self._status:
            return ""
        above = len(self._status) - 1
        return f"\r\x1b[{above}A\x1b[J" if above else "\r\x1b[K"

    def _put(self, stream: TextIO, text: str) -> None:
        """Write lines above the status."""
        if self._status:
            self._writer.put((stream, self._clear() + text))
            self._writer.put((self._output, "\n".join(self._status)))
        else:
            self._writer.put((stream, text))

    def _write(self, batch: list[tuple[TextIO, str]]) -> None:
        for stream, text in batch:
            try:
                raw(stream).write(text)
                stream.flush()
            except (OSError, ValueError):
                continue  # the reader has closed it; the run goes on
