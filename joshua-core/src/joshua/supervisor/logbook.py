"""Collects every line of a run, for the log file and the user interface."""

from __future__ import annotations

import logging
import time
from pathlib import Path

from joshua.ipc.messages import printable
from joshua.plan.events import LogEntry
from joshua.supervisor.event_bus import EventBus
from joshua.supervisor.log_files import LogFile, remove_old_logs
from joshua.supervisor.reactor import Reactor


class Logbook:
    """Writes entries to the file and publishes them. Entries of other threads go through the loop.

    Args:
        reactor: the supervisor's loop.
        events: receives the entries.
        path: of the log file.
    """

    def __init__(self, reactor: Reactor, events: EventBus, path: Path) -> None:
        self.path = path
        self.events = events
        events.on_cut_off = lambda text: self.write(logging.ERROR, text)
        self._reactor = reactor
        self._file = LogFile(path, lambda text: self._post(logging.WARNING, text))
        self._handler = _Forwarder(self)
        remove_old_logs(path.parent)

    def capture(self) -> None:
        """Adds what modules of this process log, such as the router's."""
        logging.getLogger("joshua").addHandler(self._handler)

    def write(self, level: int, text: str, node: str = "") -> None:
        """Writes a line of the supervisor about a node or about the run."""
        self.add(LogEntry(time.time_ns(), node, level, printable(text), stream="supervisor"))

    def add(self, entry: LogEntry) -> None:
        """Writes an entry. Supervisor's thread only."""
        self._file.put(entry.as_json())
        self.events.publish(entry)

    def close(self) -> None:
        """Writes pending entries and closes the file."""
        logging.getLogger("joshua").removeHandler(self._handler)
        self._file.close()
        self._reactor.run_posted()

    def _post(self, level: int, text: str, logger: str = "") -> None:
        entry = LogEntry(time.time_ns(), "", level, printable(text), logger=logger, stream="supervisor")
        self._reactor.post(lambda: self.add(entry))


class _Forwarder(logging.Handler):
    def __init__(self, logbook: Logbook) -> None:
        super().__init__()
        self._logbook = logbook

    def emit(self, record: logging.LogRecord) -> None:
        self._logbook._post(record.levelno, self.format(record), record.name)
