"""Where every line of a run comes together: the log file and the user interface."""

from __future__ import annotations

import contextlib
import logging
import os
import time
from collections import deque
from pathlib import Path

from joshua.ipc.messages import printable
from joshua.plan.events import LogEntry
from joshua.supervisor.event_bus import EventBus
from joshua.supervisor.log_files import LogFile, remove_old_logs
from joshua.supervisor.reactor import Reactor


class Logbook:
    """Writes entries to the file and shows them; entries of other threads join on the supervisor's.

    Args:
        reactor: the supervisor's loop.
        events: who watches.
        path: of the log file.
    """

    def __init__(self, reactor: Reactor, events: EventBus, path: Path) -> None:
        self._reactor = reactor
        self._foreign: deque[LogEntry] = deque(maxlen=1000)
        self._wake_receiver, self._wake_sender = os.pipe()
        os.set_blocking(self._wake_receiver, False)
        os.set_blocking(self._wake_sender, False)
        reactor.watch(self._wake_receiver, self._take_foreign)
        self.events = events
        events.on_cut_off = lambda text: self.write(logging.ERROR, text)
        self._file = LogFile(path, lambda text: self._from_thread(logging.WARNING, text))
        self._handler = _Forwarder(self)
        remove_old_logs(path.parent)

    @property
    def path(self) -> Path:
        """The log file."""
        return self._file.path

    def capture(self) -> None:
        """Takes in what modules of this process log, such as the router's keeper."""
        logger = logging.getLogger("joshua")
        logger.addHandler(self._handler)

    def write(self, level: int, text: str, node: str = "") -> None:
        """Writes a line of the supervisor's own, about a node or about the run."""
        self.add(LogEntry(time.time_ns(), node, level, printable(text), stream="supervisor"))

    def add(self, entry: LogEntry) -> None:
        """Writes an entry; supervisor's thread only."""
        self._file.put(entry.as_json())
        self.events.publish(entry)

    def close(self) -> None:
        """Writes what waits and closes the file."""
        logging.getLogger("joshua").removeHandler(self._handler)
        self._file.close()
        self._take_foreign()
        self._reactor.forget(self._wake_receiver)
        os.close(self._wake_receiver)
        os.close(self._wake_sender)

    def _from_thread(self, level: int, text: str, logger: str = "") -> None:
        self._foreign.append(
            LogEntry(time.time_ns(), "", level, printable(text), logger=logger, stream="supervisor")
        )
        try:
            os.write(self._wake_sender, b"\0")
        except OSError:
            return  # full: the loop is about to look anyway

    def _take_foreign(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self._wake_receiver, 4096)
        while self._foreign:
            self.add(self._foreign.popleft())


class _Forwarder(logging.Handler):
    def __init__(self, logbook: Logbook) -> None:
        super().__init__()
        self._logbook = logbook

    def emit(self, record: logging.LogRecord) -> None:
        self._logbook._from_thread(record.levelno, self.format(record), record.name)
