"""``joshua plan FILE``: show the nodes that a file starts, without starting them."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options, add_plan_options
from joshua.cli.report import exit_code_of, file_missing, request_of, show_findings

if TYPE_CHECKING:
    import argparse

    from joshua.plan import NodeSpec, Plan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua plan``."""
    add_config_options(parser, file="configuration to plan")
    add_plan_options(parser.add_argument_group("run"))


def run(arguments: argparse.Namespace) -> int:
    """Print the plan as text, or as JSON with ``--format json``."""
    if not arguments.config:
        return file_missing("plan")
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose
    from joshua.supervisor.tables import Screen

    result = examine(request_of(arguments, Purpose.SHOW))
    if result.plan is None:
        show_findings(result, arguments.format)
        return exit_code_of(result)
    if arguments.format == "json":
        sys.stdout.write(result.plan.model_dump_json(indent=2) + "\n")
    else:
        show_findings(result, "text")
        wrap = Screen.of(sys.stdout).wrap
        for line in plan_text(result.plan).splitlines():
            sys.stdout.write("\n".join(wrap(line, indent=13 if line[:1] == " " else 2)) + "\n")
    return ExitCode.OK


def plan_text(plan: Plan) -> str:
    """Return a plan as text: one paragraph for each node, in start order."""
    transport = plan.transport
    lines = [
        f"{plan.source}: {plan.mode}, {len(plan.nodes)} nodes",
        f"transport: {transport.kind} (domain {transport.domain_id}, {transport.distro}), {transport.reason}",
    ]
    for node in plan.nodes:
        lines += ["", *node_lines(node)]
    return "\n".join(lines) + "\n"


def without_password(text: str) -> str:
    """Hide the user and password of every address in a text, because plans are shown to others."""
    return re.sub(r"(?<=://)[^/@\s]+@", "***@", text)


def node_lines(node: NodeSpec) -> list[str]:
    """Return one node as text: implementation, host, and topics with type, rate and quality of service."""
    where = [f"process group {node.process_group}"] if node.process_group else []
    where += [f"host {node.host}"] if node.host else []
    where += [f"interpreter {node.interpreter}"] if node.interpreter else []
    lines = [
        f"{node.full_name} (id {node.node_id}): {node.role or node.kind.value}",
        f"  runs       {node.implementation} [{node.backend}] from {node.plugin}"
        + (f", {', '.join(where)}" if where else ""),
    ]
    for name, value in node.settings.items():
        lines.append(f"  setting    {name} = {without_password(str(value))}")
    for label, topics in (("publishes", node.publishers), ("subscribes", node.subscriptions)):
        for topic in topics:
            rate = f"{topic.rate_hz:g} Hz, " if topic in node.publishers else ""
            qos = f"{topic.qos.reliability} {topic.qos.durability} {topic.qos.history} {topic.qos.depth}"
            lines.append(f"  {label:<11}{topic.name} [{topic.type_name}] {rate}{qos}")
    return lines
