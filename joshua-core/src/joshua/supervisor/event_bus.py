"""Publishes the events of a run: to the terminal in this process, and to programs at the control socket."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from joshua.plan.events import Event, LogEntry, event_name, event_record

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
