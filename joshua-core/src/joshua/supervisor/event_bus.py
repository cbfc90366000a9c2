"""Who watches a run, the terminal here and others over the control socket: all get the same events."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Collection, Sequence

from joshua.plan.events import Event, LogEntry, event_name, event_record

#: Takes each event, on the supervisor's thread, and returns at once.
Subscriber = Callable[[Event], None]

#: Programs that may watch a run at the same time; the other connections are left to requests.
MAX_STREAMS = 8


class EventStream:
    """Events for a program at the other end of the control socket; the server of the socket sends them.

    Args:
        names: of the events that it wants; empty for all but log lines.
        first: what it gets at once.

    Attributes:
        abandoned: whether the program has gone.
    """

    def __init__(self, names: Collection[str] = (), first: Sequence[Event] = ()) -> None:
        self._names = frozenset(names)
        self._first = first
        self._deliver: Callable[[bytes], None] | None = None
        self.abandoned = False

    def attach(self, deliver: Callable[[bytes], None]) -> None:
        """Takes the function that sends one line, or counts it as dropped."""
        self._deliver = deliver
        for event in self._first:
            self.send(event, line_of(event))

    def send(self, event: Event, line: bytes) -> None:
        """Sends an event, if the program wants it."""
        if self._deliver is not None and self.wants(event):
            self._deliver(line)

    def wants(self, event: Event) -> bool:
        """Whether the program asked for such events."""
        return event_name(event) in self._names if self._names else not isinstance(event, LogEntry)


class EventBus:
    """Passes events on; a subscriber that raises is cut off: a display must not stop a robot's nodes.

    Args:
        subscribers: in this process.
    """

    def __init__(self, *subscribers: Subscriber) -> None:
        self._subscribers = list(subscribers)
        self._streams: list[EventStream] = []
        self.on_cut_off: Callable[[str], None] = lambda text: None

    def publish(self, event: Event) -> None:
        """Passes an event to everybody who wants it."""
        for subscriber in tuple(self._subscribers):
            try:
                subscriber(event)
            except Exception as error:
                self._subscribers.remove(subscriber)
                name = type(subscriber).__name__
                logging.getLogger("joshua.supervisor").debug("the user interface failed", exc_info=True)
                reason = f"{type(error).__name__}: {error}"
                self.on_cut_off(f"the user interface {name} failed and is cut off: {reason}")
        if self._streams:
            self._streams = [stream for stream in self._streams if not stream.abandoned]
            wanted = [stream for stream in self._streams if stream.wants(event)]
            line = line_of(event) if wanted else b""
            for stream in wanted:
                stream.send(event, line)

    def subscribe(self, stream: EventStream) -> bool:
        """Sends events to a program from now on; returns False where too many watch already."""
        self._streams = [known for known in self._streams if not known.abandoned]
        if len(self._streams) >= MAX_STREAMS:
            return False
        self._streams.append(stream)
        return True


def line_of(event: Event) -> bytes:
    """An event as one JSON line."""
    return json.dumps(event_record(event)).encode() + b"\n"
