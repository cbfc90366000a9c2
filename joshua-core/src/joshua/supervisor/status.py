"""What a run shows of itself: start-up table, live status, log entries, events."""

from __future__ import annotations

import json
import logging
import time
from dataclasses import asdict, dataclass, field

from joshua.plan import Diagnostic, TopicSpec


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
    """Shown once, when every node is ready.

    Attributes:
        transport: which one runs and why; ready_s: from the start to the last ready report.
        notes: what holds for the whole run; findings: of the configuration.
    """

    source: str
    mode: str
    robot: str
    transport: str
    ready_s: float
    nodes: tuple[NodeRow, ...]
    notes: tuple[str, ...] = ()
    findings: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True)
class NodeStatus:
    """One node just now.

    Attributes:
        state: ``starting``, ``configured``, ``ready``, ``fault`` (it runs, and its device does nothing
            until it is resumed), ``resuming``, ``restarting``, ``stopping``, ``stopped``, ``failed`` or
            ``killed``; reason: of a failure or a fault.
        doing: step of the lifecycle, and what it waits for; shown: what the node tells people of itself.
        published_hz, received_hz: rates by topic over the last seconds.
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


@dataclass(frozen=True)
class RunStatus:
    """A run just now; ``phase`` is ``starting``, ``running`` or ``stopping``."""

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
    """Something that happened to a node ("" for the run).

    ``kind`` is ``ready``, ``fault``, ``failed``, ``restarting``, ``given-up``, ``stopping`` or ``ended``.
    """

    kind: str
    node: str
    text: str


@dataclass(frozen=True)
class LogEntry:
    """One line of the log; ``node`` is "" for the supervisor, ``stream`` where the line came from."""

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
        """The entry as one JSON line, without its end."""
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
