"""Events of a run: start-up table, live status, log, progress, state changes of nodes."""

from __future__ import annotations

import json
import logging
import time
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

from pydantic import TypeAdapter

from joshua.plan.diagnostic import Diagnostic
from joshua.plan.node_spec import TopicSpec
from joshua.plan.progress import Progress
from joshua.plan.report import RunReport


@dataclass(frozen=True)
class NodeRow:
    """One row of the start-up table."""

    full_name: str
    process_id: int
    backend: str
    role: str = ""
    plugin: str = ""
    publishers: tuple[TopicSpec, ...] = ()
    subscriptions: tuple[TopicSpec, ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class StartTable:
    """The start-up table, shown once, when every node is ready.

    Attributes:
        transport: the one in use and why; ready_s: from the start to the last ready report.
        visible: which ROS 2 tools see the run, and which setting extends that.
        commands: who can command the run over the transport.
        notes: notes on the whole run; findings: of the configuration.
    """

    source: str
    mode: str
    robot: str
    transport: str
    ready_s: float
    nodes: tuple[NodeRow, ...]
    notes: tuple[str, ...] = ()
    findings: tuple[Diagnostic, ...] = ()
    visible: str = ""
    commands: str = ""


@dataclass(frozen=True)
class NodeStatus:
    """The status of one node.

    Attributes:
        state: ``starting``, ``configured``, ``ready``, ``fault`` (it runs, but its device is stopped until it
            is resumed), ``resuming``, ``restarting``, ``stopping``, ``stopped``, ``failed`` or ``killed``;
            reason: of a failure or a fault.
        doing: step of the lifecycle, and what it waits for; shown: its text for the status line.
        progress: of unfinished work.
        published_hz, received_hz: rates by topic over the last seconds; target_hz: of publishers.
    """

    full_name: str
    state: str
    process_id: int
    restarts: int
    doing: str = ""
    reason: str = ""
    shown: str = ""
    published_hz: dict[str, float] = field(default_factory=dict)
    received_hz: dict[str, float] = field(default_factory=dict)
    target_hz: dict[str, float] = field(default_factory=dict)
    progress: tuple[Progress, ...] = ()


@dataclass(frozen=True)
class RunStatus:
    """The status of a run. ``phase`` is ``starting``, ``running`` or ``stopping``."""

    source: str
    mode: str
    phase: str
    elapsed_s: float
    process_id: int
    nodes: tuple[NodeStatus, ...]

    def as_dict(self) -> dict[str, object]:
        """The status as JSON-able data."""
        return asdict(self)


@dataclass(frozen=True)
class RunEvent:
    """A state change of a node ("" for the run).

    Attributes:
        kind: ``started``, ``restarted``, ``ready``, ``fault`` (its device is stopped), ``resumed`` (the fault
            has ended), ``failed``, ``restarting``, ``given-up`` (it stays down), ``stopping``, ``stopped`` or
            ``killed``.
        time_ns: since the epoch.
    """

    kind: str
    node: str
    text: str
    time_ns: int = 0


@dataclass(frozen=True)
class LogEntry:
    """One line of the log; ``node`` is "" for the supervisor, ``stream`` the origin of the line."""

    time_ns: int
    node: str
    level: int
    text: str
    logger: str = ""
    stream: str = "log"
    file: str = ""
    line: int = 0

    @property
    def level_name(self) -> str:
        """Name of the level, such as WARNING."""
        return logging.getLevelName(self.level)

    def as_json(self) -> str:
        """The entry as one JSON line, without the line break."""
        seconds, nanoseconds = divmod(self.time_ns, 1_000_000_000)
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(seconds))
        record: dict[str, object] = {
            "time": f"{stamp}.{nanoseconds // 1000:06d}Z",
            "level": self.level_name,
            "node": self.node,
            "text": self.text,
            "stream": self.stream,
        }
        if self.logger:
            record["logger"] = self.logger
        if self.file:
            record["place"] = f"{self.file}:{self.line}"
        return json.dumps(record, ensure_ascii=False)


@dataclass(frozen=True)
class Gap:
    """Some events were dropped because the subscriber reads too slowly."""

    dropped: int


Event = StartTable | RunStatus | LogEntry | RunEvent | Progress | RunReport | Gap

#: Names of the events in the stream. The name of a ``RunEvent`` is its kind.
_NAMES: dict[type, str] = {
    StartTable: "table",
    RunStatus: "status",
    LogEntry: "log",
    Progress: "progress",
    RunReport: "report",
    Gap: "gap",
}

#: Events that can be requested from the stream.
EVENT_NAMES = (
    *_NAMES.values(),
    *("started", "restarted", "ready", "fault", "resumed", "failed"),
    *("restarting", "given-up", "stopping", "stopped", "killed"),
)


def event_name(event: Event) -> str:
    """The name of an event in the stream, such as ``status`` or ``ready``."""
    return event.kind if isinstance(event, RunEvent) else _NAMES[type(event)]


def event_record(event: Event) -> dict[str, Any]:
    """An event as JSON-able data: its name as ``event``, and its fields."""
    kind: Any = type(event)
    fields = _adapter(kind).dump_python(event, mode="json")
    return {"event": event_name(event), **fields}


def event_of(record: dict[str, Any]) -> Event:
    """The event of a record. Raises ValueError."""
    fields = {name: value for name, value in record.items() if name != "event"}
    made = next((kind for kind, name in _NAMES.items() if name == record.get("event")), RunEvent)
    return _adapter(made).validate_python(fields)  # type: ignore[no-any-return]


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
