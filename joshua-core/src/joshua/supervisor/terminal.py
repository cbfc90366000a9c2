"""A run in the terminal: start-up table, log lines, live status, cadence report."""

from __future__ import annotations

import os
import shutil
import sys
import time
from typing import TextIO

from joshua.config.diagnostics import wants_color
from joshua.plan import RunReport
from joshua.plan.events import Event, LogEntry, RunStatus, StartTable
from joshua.supervisor.log_files import BackgroundWriter
from joshua.supervisor.tables import log_line, report_lines, start_lines, status_line

#: Distance of two status lines where the output is no terminal.
PLAIN_STATUS_PERIOD_S = 10.0

#: How long the last lines may take to leave.
CLOSE_TIMEOUT_S = 2.0

_CLEAR = "\r\x1b[K"
_COLOURS = {"WARNING": "\x1b[33m", "ERROR": "\x1b[31m", "CRITICAL": "\x1b[31;1m", "DEBUG": "\x1b[2m"}
_RESET = "\x1b[0m"


class Terminal:
    """Shows a run as text; a terminal that stands still holds up nobody.

    Args:
        log_level: least level of the log lines shown, as in ``logging``.
        output: table, status and report; errors: log lines.
    """

    def __init__(self, log_level: int, output: TextIO | None = None, errors: TextIO | None = None) -> None:
        self._log_level = log_level
        self._output = output or sys.stdout
        self._errors = errors or sys.stderr
        self._live = self._output.isatty() and os.environ.get("TERM") != "dumb"
        self._colour = wants_color(self._errors)
        self._status = ""
        self._plain_due_s = 0.0
        self._writer = BackgroundWriter[tuple[TextIO, str]](self._write, "terminal")

    def __call__(self, event: Event) -> None:
        """Shows an event; those that the log says in words are shown by that."""
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
        self._put(self._output, "\n".join(start_lines(table)) + "\n")

    def _on_status(self, status: RunStatus) -> None:
        """Renews the status line; prints one now and then where the output is no terminal."""
        line = status_line(status)
        if self._live:
            width = shutil.get_terminal_size().columns
            self._status = line[: width - 1]
            self._writer.put((self._output, f"{_CLEAR}{self._status}"))
        elif status.phase == "running" and time.monotonic() >= self._plain_due_s:
            self._plain_due_s = time.monotonic() + PLAIN_STATUS_PERIOD_S
            self._writer.put((self._output, line + "\n"))

    def _on_log(self, entry: LogEntry) -> None:
        """Shows a log line of sufficient level."""
        if entry.level < self._log_level:
            return
        line = log_line(entry)
        if self._colour and entry.level_name in _COLOURS:
            line = f"{_COLOURS[entry.level_name]}{line}{_RESET}"
        self._put(self._errors, line + "\n")

    def _on_finish(self, report: RunReport) -> None:
        """Shows the cadence report and writes what waits."""
        status, self._status = self._status, ""
        if status:
            self._writer.put((self._output, _CLEAR))
        self._put(self._output, "\n".join(report_lines(report)) + "\n")
        self._writer.close(CLOSE_TIMEOUT_S)

    def _put(self, stream: TextIO, text: str) -> None:
        """Writes lines above the status line."""
        if self._live and self._status:
            text = f"{_CLEAR}{text}"
            self._writer.put((stream, text))
            self._writer.put((self._output, self._status))
        else:
            self._writer.put((stream, text))

    def _write(self, batch: list[tuple[TextIO, str]]) -> None:
        for stream, text in batch:
            try:
                stream.write(text)
                stream.flush()
            except (OSError, ValueError):
                continue  # nobody reads any more; the run goes on
