"""What a run shows of itself, made from what the supervisor knows."""

from __future__ import annotations

import os
from collections.abc import Sequence

from joshua.plan import Plan
from joshua.plan.events import RunStatus, StartTable
from joshua.supervisor.node_record import NodeRecord


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
    )


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
