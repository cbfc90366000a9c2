"""Fixtures for tests that supervise real child processes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from joshua.plan import NodeKind, NodeSpec, Plan, RunReport, TopicSpec, TransportSettings
from joshua.plan.events import Event, LogEntry, RunEvent, RunStatus, StartTable
from joshua.plan.progress import Progress
from joshua.supervisor import fork_server
from joshua.supervisor.fork_server import ForkServer
from joshua.supervisor.heartbeats import HANG_AFTER_S
from joshua.supervisor.policies import RestartLimits, SupervisorOptions
from joshua.supervisor.supervisor import Supervisor
from joshua.testing.domain import reserved_domain
from joshua.testing.program import router_port

BEHAVIOURS = Path(__file__).parent / "behaviours"


class Recorder:
    """A user interface that keeps everything, and looks at each change whether something has come about."""

    def __init__(self) -> None:
        self.tables: list[StartTable] = []
        self.statuses: list[RunStatus] = []
        self.entries: list[LogEntry] = []
        self.events: list[RunEvent] = []
        self.reports: list[RunReport] = []
        self.progress: list[Progress] = []
        self.on_ready: Any = None
        self.until: Callable[[], object] | None = None
        self.on_reached: Callable[[], None] = lambda: None

    def __call__(self, event: Event) -> None:
        kept: dict[type, list[Any]] = {
            StartTable: self.tables,
            RunStatus: self.statuses,
            LogEntry: self.entries,
            RunEvent: self.events,
            RunReport: self.reports,
            Progress: self.progress,
        }
        kept[type(event)].append(event)
        if isinstance(event, StartTable) and self.on_ready is not None:
            self.on_ready(event)
        if isinstance(event, (RunStatus, LogEntry)):
            self._look()

    def _look(self) -> None:
        if self.until is not None and self.until():
            self.until = None
            self.on_reached()

    def text(self, node: str | None = None) -> str:
        """The log as text, of one node or of all."""
        return "\n".join(
            f"{entry.level_name} {entry.node}: {entry.text}"
            for entry in self.entries
            if node is None or entry.node == node
        )

    def kinds(self, node: str) -> list[str]:
        """The kinds of the events of a node."""
        return [event.kind for event in self.events if event.node == node]


class Robot:
    """Makes plans of test behaviours and runs them."""

    def __init__(self, server: ForkServer, folder: Path, domain_id: int) -> None:
        self.server = server
        self.folder = folder
        self.ui = Recorder()
        self.transport = TransportSettings(
            domain_id=domain_id, listen_endpoints=(f"tcp/localhost:{router_port(domain_id)}",)
        )
        self.notes = folder / "notes"

    def node(self, behaviour: str, name: str = "", **fields: Any) -> NodeSpec:
        """A node that runs a test behaviour; its kind is a sensor unless said otherwise."""
        settings = {"notes": str(self.notes), **fields.pop("settings", {})}
        module = fields.pop("module", "runtime_behaviours")
        return NodeSpec(
            name=name or behaviour.lower(),
            kind=fields.pop("kind", NodeKind.SENSOR),
            behaviour=f"{module}:{behaviour}",
            implementation="",
            settings=settings,
            **fields,
        )

    def plan(self, *nodes: NodeSpec, **fields: Any) -> Plan:
        fields = {"mode": "MODE_TEST", "verdict": True, **fields}
        return Plan(source="robot.pbtxt", nodes=nodes, transport=self.transport, **fields)

    def options(self, **fields: Any) -> SupervisorOptions:
        defaults: dict[str, Any] = {
            "run_base": self.folder / "run",
            "log_directory": self.folder / "log",
            "restart": RestartLimits(first_delay_s=0.02, max_delay_s=0.1, failures=3),
            "log_level": 10,
            "start_timeout_s": 60.0,
        }
        return SupervisorOptions(**{**defaults, **fields})

    def run(self, *nodes: NodeSpec, duration_s: float | None = 0.3, **fields: Any) -> RunReport:
        """Runs nodes to the end."""
        options = self.options(duration_s=duration_s, **fields)
        return Supervisor(self.plan(*nodes), self.server, options, self.ui).run()

    def run_until(self, reached: Callable[[], object], *nodes: NodeSpec, **fields: Any) -> RunReport:
        """Runs nodes until something has come about, however long that takes, and stops them then."""
        options = self.options(duration_s=60.0, status_period_s=0.05, **fields)
        supervisor = Supervisor(self.plan(*nodes), self.server, options, self.ui)
        self.ui.until = reached
        self.ui.on_reached = lambda: supervisor.stop_soon("it has come about")
        return supervisor.run()

    def noted(self) -> list[str]:
        """What the behaviours noted, in order."""
        return self.notes.read_text().splitlines() if self.notes.exists() else []


def string_topic(name: str, rate_hz: float = 0.0) -> TopicSpec:
    """A topic of strings."""
    return TopicSpec(name=name, type_name="std_msgs/msg/String", rate_hz=rate_hz)


@pytest.fixture(scope="session")
def fork_server_shared() -> Iterator[ForkServer]:
    """One fork server for all tests that leave it alive; its children find the test behaviours."""
    sys.path.insert(0, str(BEHAVIOURS))
    server = fork_server.start()
    yield server
    server.close()
    sys.path.remove(str(BEHAVIOURS))


@pytest.fixture
def robot(fork_server_shared: ForkServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    """Runs plans in a folder of the test's own; a busy machine must not look like a hang."""
    for kind in NodeKind:
        monkeypatch.setitem(HANG_AFTER_S, kind, 20.0)
    with reserved_domain() as domain_id:
        yield Robot(fork_server_shared, tmp_path, domain_id)
