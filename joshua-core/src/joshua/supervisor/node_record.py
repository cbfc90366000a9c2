"""What the supervisor knows of a node, and what a run shows of itself from that."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from joshua.ipc.messages import Topics
from joshua.plan import NodeReport, NodeSpec, Plan, TopicReport, TopicSpec, TransportSettings
from joshua.plan.events import NodeRow, NodeStatus, Progress, RunStatus, StartTable

#: Running totals that the live rates are computed from: five, half a second apart.
RATE_WINDOW = 5

#: What a step of the lifecycle is called in messages.
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
    """One node's state, over all processes that have run it.

    Attributes:
        state: as in ``NodeStatus``; step: of the lifecycle; waiting: what the node says it waits for;
            shown: what it shows in the status line; progress: of its work, by name.
        fault: why its device does nothing although the node runs; "" for none.
        reason: why it failed; exit_code: that the failure calls for.
        report: its own last report; None if it ended without one.
    """

    spec: NodeSpec
    state: str = "starting"
    step: str = ""
    waiting: str = ""
    fault: str = ""
    shown: str = ""
    progress: dict[str, Progress] = field(default_factory=dict)
    process_id: int = 0
    restarts: int = 0
    reason: str = ""
    exit_code: int = 0
    warnings: list[str] = field(default_factory=list)
    report: NodeReport | None = None
    totals: deque[Topics] = field(default_factory=lambda: deque(maxlen=RATE_WINDOW))
    first_totals: Topics | None = None

    @property
    def doing(self) -> str:
        """What the node does now, for messages."""
        text = STEP_NAMES.get(self.step, self.step)
        return f"{text}, waiting for {self.waiting}" if self.waiting else text

    def begin(self) -> None:
        """A process for the node starts."""
        self.state, self.step, self.waiting, self.process_id = "starting", "", "", 0
        self.fault = self.shown = ""
        self.report = None
        self.progress.clear()
        self.warnings.clear()
        self.totals.clear()
        self.first_totals = None

    def fail(self, reason: str, exit_code: int) -> None:
        """Notes a failure; the first one of a process counts."""
        if self.state != "failed":
            self.state, self.reason, self.exit_code = "failed", reason, exit_code

    def say(self, kind: str, text: str) -> None:
        """Takes a text of the node, by the kind of ``Said``."""
        if kind == "warning":
            self.warnings.append(text)
        elif kind in ("waiting", "shown", "fault"):
            setattr(self, kind, text)

    def count(self, totals: Topics) -> None:
        """Takes running totals."""
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
        """The node just now."""
        published: dict[str, float] = {}
        received: dict[str, float] = {}
        if len(self.totals) > 1:
            first, last = self.totals[0], self.totals[-1]
            length_s = (last.stamp_ns - first.stamp_ns) / 1e9
            published = _rates(first.published, last.published, length_s)
            received = _rates(first.received, last.received, length_s)
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
        """The node's share of the run report; the supervisor's own figures where it left none."""
        report = self.report or NodeReport(
            full_name=self.spec.full_name,
            state=self.state,
            topics=self._topics_from_totals(),
            warnings=tuple(self.warnings),
        )
        return report.model_copy(
            update={"state": self.state, "reason": self.reason or self.fault, "restarts": self.restarts}
        )

    def _topics_from_totals(self) -> tuple[TopicReport, ...]:
        if not self.totals or self.first_totals is None:
            return ()
        first, last = self.first_totals, self.totals[-1]
        length_s = (last.stamp_ns - first.stamp_ns) / 1e9
        published = _rates(first.published, last.published, length_s)
        received = _rates(first.received, last.received, length_s)
        spec = self.spec
        return (
            *(_topic(item, True, last.published, published) for item in spec.publishers),
            *(_topic(item, False, last.received, received) for item in spec.subscriptions),
        )


def _rates(first: dict[str, int], last: dict[str, int], length_s: float) -> dict[str, float]:
    if length_s <= 0:
        return {}
    return {name: (count - first.get(name, 0)) / length_s for name, count in last.items()}


def _topic(
    topic: TopicSpec, is_publisher: bool, counts: dict[str, int], rates: dict[str, float]
) -> TopicReport:
    return TopicReport(
        name=topic.name,
        type_name=topic.type_name,
        is_publisher=is_publisher,
        count=counts.get(topic.name, 0),
        rate_hz=rates.get(topic.name, 0.0),
        configured_hz=topic.rate_hz,
    )


def start_table(
    plan: Plan, records: Sequence[NodeRecord], ready_s: float, notes: Sequence[str]
) -> StartTable:
    """The start-up table; ``ready_s`` counts from the start to the last ready report."""
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
        visible=visible_to(transport),
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
            f"on this machine, with {domain} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST; for those with their "
            "defaults and for other machines, start with ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
        )
    return f"in the local network, with {domain}"


def run_status(plan: Plan, records: Sequence[NodeRecord], phase: str, elapsed_s: float) -> RunStatus:
    """The live status."""
    return RunStatus(
        source=plan.source,
        mode=plan.mode,
        phase=phase,
        elapsed_s=elapsed_s,
        process_id=os.getpid(),
        nodes=tuple(record.status() for record in records),
    )
