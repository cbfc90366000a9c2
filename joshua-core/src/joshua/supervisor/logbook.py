"""Events and log of a run: to the terminal, to programs at the control socket, and into the log file."""

from __future__ import annotations

import json
import logging
import time
import traceback
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.plan.events import Event, LogEntry, event_name, event_record
from joshua.plan.foreign_text import printable
from joshua.supervisor.log_files import LogFile, remove_old_logs
from joshua.supervisor.reactor import Reactor

if TYPE_CHECKING:
    from joshua.supervisor.control_server import Connection

#: Takes each event on the supervisor's thread and returns at once.
Subscriber = Callable[[Event], None]

#: Programs that may subscribe at the same time. The other connections are left to requests.
MAX_STREAMS = 8


class Logbook(logging.Handler):
    """Publishes events and writes log entries. Those of other threads go through the loop.

    Args:
        reactor: the supervisor's loop.
        path: of the log file.
        ui: receives every event. It is removed if it raises: a display must not stop a robot's nodes.
    """

    def __init__(self, reactor: Reactor, path: Path, ui: Subscriber | None = None) -> None:
        super().__init__()
        self.path = path
        self._reactor = reactor
        self._ui = ui
        self._streams: list[tuple[Connection, frozenset[str]]] = []
        self._file = LogFile(path, lambda text: self._post(logging.WARNING, text))
        remove_old_logs(path.parent)

    def publish(self, event: Event) -> None:
        """Passes an event to the user interface and to the programs that want it."""
        try:
            if self._ui is not None:
                self._ui(event)
        except Exception as error:  # noqa: BLE001 (whatever a display raises)
            name, self._ui = getattr(self._ui, "__name__", type(self._ui).__name__), None
            self.write(logging.DEBUG, traceback.format_exc().rstrip())
            reason = f"{type(error).__name__}: {error}"
            self.write(logging.ERROR, f"the user interface {name} failed and is disconnected: {reason}")
        if self._streams:
            self._streams = [item for item in self._streams if not item[0].closed]
            line = b""
            for connection, names in self._streams:
                if event_name(event) in names if names else not isinstance(event, LogEntry):
                    line = line or json.dumps(event_record(event)).encode() + b"\n"
                    connection.offer(line)

    def subscribe(self, connection: Connection, names: Collection[str] = ()) -> bool:
        """Sends events to a program. Returns False if too many programs are subscribed.

        Args:
            names: of the wanted events; empty for all but log lines.
        """
        self._streams = [item for item in self._streams if not item[0].closed]
        if len(self._streams) >= MAX_STREAMS:
            return False
        self._streams.append((connection, frozenset(names)))
        return True

    def write(self, level: int, text: str, node: str = "") -> None:
        """Writes a line of the supervisor about a node or about the run."""
        self.add(LogEntry(time.time_ns(), node, level, text, stream="supervisor"))

    def add(self, entry: LogEntry) -> None:
        """Writes an entry, its text printable. Supervisor's thread only."""
        entry = replace(entry, text=printable(entry.text))
        self._file.put(entry.as_json())
        self.publish(entry)

    def capture(self) -> None:
        """Adds what modules of this process log, such as the router's."""
        logging.getLogger("joshua").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Adds a record of any thread."""
        self._post(record.levelno, self.format(record), record.name)

    def close(self) -> None:
        """Writes pending entries and closes the file."""
        logging.getLogger("joshua").removeHandler(self)
        self._file.close()
        self._reactor.run_posted()
        super().close()

    def _post(self, level: int, text: str, logger: str = "") -> None:
        entry = LogEntry(time.time_ns(), "", level, text, logger=logger, stream="supervisor")
        self._reactor.post(lambda: self.add(entry))
