"""Events and log of a run: to the terminal, to programs at the control socket, and into the log file."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.ipc.messages import printable
from joshua.plan.events import Event, LogEntry, event_name, event_record
from joshua.supervisor.log_files import LogFile, remove_old_logs
from joshua.supervisor.reactor import Reactor

if TYPE_CHECKING:
    from joshua.supervisor.control_server import Connection

#: Takes each event on the supervisor's thread and returns at once.
Subscriber = Callable[[Event], None]

#: Programs that may subscribe at the same time. The other connections are left to requests.
MAX_STREAMS = 8


class EventBus:
    """Publishes events. A subscriber that raises is removed: a display must not stop a robot's nodes.

    Args:
        subscribers: in this process.
    """

    def __init__(self, *subscribers: Subscriber) -> None:
        self._subscribers = list(subscribers)
        self._streams: list[tuple[Connection, frozenset[str]]] = []
        self.on_cut_off: Callable[[str], None] = lambda text: None

    def publish(self, event: Event) -> None:
        """Passes an event to its subscribers."""
        for subscriber in tuple(self._subscribers):
            try:
                subscriber(event)
            except Exception as error:
                self._subscribers.remove(subscriber)
                name = type(subscriber).__name__
                logging.getLogger("joshua.supervisor").debug("the user interface failed", exc_info=True)
                reason = f"{type(error).__name__}: {error}"
                self.on_cut_off(f"the user interface {name} failed and is disconnected: {reason}")
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
