"""State of each node in the supervisor, and the tables made from it."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from joshua.ipc.messages import Topics
from joshua.plan import NodeReport, NodeSpec, Plan, TopicReport, TransportSettings
from joshua.plan.events import NodeRow, NodeStatus, RunStatus, StartTable
from joshua.plan.progress import Progress

#: Totals for the live rates: five, half a second apart.
RATE_WINDOW = 5

#: Lifecycle steps in messages.
STEP_NAMES = {
    "": "starting its process",
    "import": "importing its code",
    "transport": "joining the ROS 2 graph",
    "configure": "in its configure step",
    "configured": "configured",
    "activate": "in its activate step",
    "active": "in its loop",
    "deactivate": "in its deactivate step",
    "cleanup": "in its cleanup step",
    "finished": "ending its process",
}


@dataclass
class NodeRecord:
    """One node's state, over all its processes.

    Attributes:
        state: as in ``NodeStatus``; step: of the lifecycle; waiting: what the node waits for;
            shown: its text in the status line; progress: of its work, by name.
        priority: what the system granted to its control loop, "" if it has none.
        fault: why its device is stopped although the node runs, "" for none.
        reason: why it failed; exit_code: of such a failure; kill_reason: why its guardian killed it.
        last_failure: why the process before this one ended.
        report: its own last report, None if it ended without one.
    """

    spec: NodeSpec
    state: str = "starting"
    step: str = ""
    waiting: str = ""
    fault: str = ""
    shown: str = ""
    priority: str = ""
    progress: dict[str, Progress] = field(default_factory=dict)
    process_id: int = 0
    restarts: int = 0
    reason: str = ""
    kill_reason: str = ""
    last_failure: str = ""
    exit_code: int = 0
    warnings: list[str] = field(default_factory=list)
    report: NodeReport | None = None
    totals: deque[Topics] = field(default_factory=lambda: deque(maxlen=RATE_WINDOW))
    first_totals: Topics | None = None

    @property
    def doing(self) -> str:
        """Current activity, for messages."""
        text = STEP_NAMES.get(self.step, self.step)
        return f"{text}, waiting for {self.waiting}" if self.waiting else text

    def begin(self) -> None:
        """Resets the state for a new process."""
        self.state, self.step, self.waiting, self.process_id = "starting", "", "", 0
        self.last_failure = self.kill_reason or self.reason or self.last_failure
        self.fault = self.shown = self.kill_reason = ""
        self.report = None
        self.progress.clear()
        self.warnings.clear()
        self.totals.clear()
        self.first_totals = None

    def fail(self, reason: str, exit_code: int) -> None:
        """Notes a failure. The first one of a process counts."""
        if self.state != "failed":
            self.state, self.reason, self.exit_code = "failed", reason, exit_code

    def say(self, kind: str, text: str) -> None:
        """Takes a text of the node, by the kind of ``Said``."""
        if kind == "warning":
            self.warnings.append(text)
        elif kind in ("waiting", "shown", "fault", "priority"):
            setattr(self, kind, text)

    def count(self, totals: Topics) -> None:
        """Takes message totals."""
        self.first_totals = self.first_totals or totals
        self.totals.append(totals)

    def row(self) -> NodeRow:
        """The node's row of the start-up table."""
        spec = self.spec
        return NodeRow(
            full_name=spec.full_name,
            process_id=self.process_id,
            backend=spec.backend,
            role=spec.role,
            plugin=spec.plugin,
            publishers=spec.publishers,
            subscriptions=spec.subscriptions,
            warnings=tuple(self.warnings),
        )

    def status(self) -> NodeStatus:
        """Current status."""
        published, received = _rates(self.totals[0], self.totals[-1]) if self.totals else ({}, {})
        return NodeStatus(
            full_name=self.spec.full_name,
            state="fault" if self.state == "ready" and self.fault else self.state,
            process_id=self.process_id,
            restarts=self.restarts,
            doing=self.doing,
            reason=self.reason or self.fault,
            shown=self.shown,
            published_hz=published,
            received_hz=received,
            target_hz={topic.name: topic.rate_hz for topic in self.spec.publishers if topic.rate_hz},
            progress=tuple(item for item in self.progress.values() if item.current != item.total),
        )

    def final_report(self) -> NodeReport:
        """Final report of the node, from the supervisor's figures if it left none."""
        report = self.report or NodeReport(
            full_name=self.spec.full_name,
            state=self.state,
            topics=self._topics_from_totals(),
            warnings=tuple(self.warnings),
        )
        reason = self.reason or self.fault
        update = {"state": self.state, "reason": reason, "restarts": self.restarts}
        return report.model_copy(update={**update, "last_failure": self.last_failure})

    def _topics_from_totals(self) -> tuple[TopicReport, ...]:
        if not self.totals or self.first_totals is None:
            return ()
        last, rates = self.totals[-1], _rates(self.first_totals, self.totals[-1])
        return tuple(
            TopicReport(
                name=topic.name,
                type_name=topic.type_name,
                is_publisher=counts is last.published,
                count=counts.get(topic.name, 0),
                rate_hz=rate_hz.get(topic.name, 0.0),
                configured_hz=topic.rate_hz,
            )
            for topics, counts, rate_hz in (
                (self.spec.publishers, last.published, rates[0]),
                (self.spec.subscriptions, last.received, rates[1]),
            )
            for topic in topics
        )


def _rates(first: Topics, last: Topics) -> tuple[dict[str, float], dict[str, float]]:
    """Rates of published and received topics between two totals."""
    length_s = (last.stamp_ns - first.stamp_ns) / 1e9
    if length_s <= 0:
        return {}, {}
    published, received = (
        {name: (count - before.get(name, 0)) / length_s for name, count in after.items()}
        for before, after in ((first.published, last.published), (first.received, last.received))
    )
    return published, received


def start_table(
    plan: Plan, records: Sequence[NodeRecord], ready_s: float, notes: Sequence[str]
) -> StartTable:
    """The start-up table. ``ready_s`` is the time from the start to the last ready report."""
    transport = plan.transport
    return StartTable(
        source=plan.source,
        mode=plan.mode,
        robot=plan.robot_name or plan.robot_id,
        transport=f"{transport.kind} ({transport.reason}), domain {transport.domain_id}",
        ready_s=ready_s,
        nodes=tuple(record.row() for record in records),
        notes=tuple(notes),
        findings=plan.findings,
        visible=". ".join(filter(None, (visible_to(transport), transport.limits))),
        commands=commanded_by(transport),
    )


def visible_to(transport: TransportSettings) -> str:
    """Which ROS 2 tools see a run, and which setting lets more see it."""
    domain = f"ROS_DOMAIN_ID={transport.domain_id}"
    if transport.kind == "zenoh":
        tools = f"with RMW_IMPLEMENTATION=rmw_zenoh_cpp {domain}"
        if all("localhost" in item or "127.0.0.1" in item for item in transport.listen_endpoints):
            return f"on this machine, {tools}; for other machines, set transport.listen_endpoints"
        return f"{tools}, connected to {', '.join(transport.listen_endpoints)}"
    if transport.discovery_range == "OFF":
        return "none; ROS_AUTOMATIC_DISCOVERY_RANGE=OFF hides the run, set LOCALHOST or SUBNET"
    if transport.discovery_range == "LOCALHOST":
        return (
            f"on this machine, with {domain}, and for Cyclone DDS ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST; "
            "for other machines, start with ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
        )
    return f"in the local network, with {domain} and their default discovery range"


def commanded_by(transport: TransportSettings) -> str:
    """Who can command a run over its transport; "" if only the transport's own settings say."""
    if transport.discovery_range == "OFF":
        return ""
    if transport.kind == "dds":
        local = transport.discovery_range == "LOCALHOST"
        who = "every user of this machine" if local else "everyone in the local network"
        return f"unprotected: {who} can command, because DDS without SROS 2 has no access control"
    if transport.kind != "zenoh":
        return ""
    from joshua.transport.zenoh.meeting import reach_of

    reach = reach_of(transport)
    if reach == "this user":
        return "from this user and root; other users of this machine can only watch"
    if reach == "certificates":
        return "from everyone with a certificate of the authority in root_ca_file"
    where = ", ".join((*transport.listen_endpoints, *transport.connect_endpoints))
    return f"unprotected: everyone who reaches {where} can command"


def priority_notes(records: Sequence[NodeRecord]) -> list[str]:
    """Notes for the start-up table: which priority the control loops have."""
    nodes: dict[str, list[str]] = {}
    for record in records:
        if record.priority:
            nodes.setdefault(record.priority, []).append(record.spec.full_name)
    remedy = "; a busy machine delays them: run `joshua doctor`"
    return [
        f"priority of {', '.join(names)}: {text}{remedy if text.startswith('normal') else ''}"
        for text, names in nodes.items()
    ]


def run_status(plan: Plan, records: Sequence[NodeRecord], phase: str, elapsed_s: float) -> RunStatus:
    """The live status of the run."""
    return RunStatus(
        source=plan.source,
        mode=plan.mode,
        phase=phase,
        elapsed_s=elapsed_s,
        process_id=os.getpid(),
        nodes=tuple(record.status() for record in records),
    )
