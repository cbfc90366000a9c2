"""MODE_TEST: at least one device, followers that match their leaders, and the pass/fail table at the end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from joshua.config.checks import Context
from joshua.modes.queries import lacks
from joshua.modes.services import SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.modes.teleoperate import joint_counts, leaders
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.plan import CheckResult, NodeReport, Plan, RunReport

#: The first row of each node.
RAN = "runs to the end"


def check(context: Context) -> Iterator[Diagnostic]:
    """Require at least one device or model."""
    if not context.graph.entries:
        yield lacks(context, "mode-lacks-device", "at least one device to test", "robot")
    sources = leaders(context)
    for entry in context.graph.actuators:
        yield from joint_counts(context, entry, sources)


def verdict(plan: Plan, report: RunReport) -> list[tuple[str, CheckResult]]:
    """Evaluate a test run.

    Returns:
        Pairs of node name and check, in the order of the plan. first whether the node ran to the end,
        then what the node measured itself.
    """
    from joshua.plan import CheckResult

    reports = {node.full_name: node for node in report.nodes}
    rows: list[tuple[str, CheckResult]] = []
    for spec in plan.nodes:
        node = reports.get(spec.full_name)
        if node is None:
            rows.append((spec.full_name, CheckResult(check="starts", passed=False, measured="never started")))
            continue
        rows.append((spec.full_name, _ran(node, report)))
        rows += [(spec.full_name, check) for check in node.checks]
    return rows


def _ran(node: NodeReport, report: RunReport) -> CheckResult:
    from joshua.plan import CheckResult

    good = node.state == "stopped" and node.restarts == 0 and not report.interrupted
    ending = node.reason or (report.reason if report.interrupted else "" if node.restarts else node.state)
    measured = "; ".join(filter(None, (node.restarted, ending)))
    return CheckResult(check=RAN, passed=good, measured=measured)


def passed(rows: list[tuple[str, CheckResult]]) -> bool:
    """Whether every check passed. A test without a check has not passed."""
    return bool(rows) and all(check.passed for _, check in rows)


def _duration_s(config: pb.Config) -> float:
    if config.test.HasField("duration_s"):
        return float(config.test.duration_s)
    from joshua.schema.rules import rule

    return float(rule(pb.TestConfig.DESCRIPTOR.fields_by_name["duration_s"]).default)


SPEC = ModeSpec(
    "MODE_TEST",
    check,
    models=True,
    services=(SIMULATION,),
    blocks=("test",),
    duration_s=_duration_s,
    verdict=True,
    works_uncalibrated=True,
)
