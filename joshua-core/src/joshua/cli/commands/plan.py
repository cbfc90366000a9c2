"""``joshua plan``: show what a file would start, and start nothing."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options, add_stand_in_options
from joshua.cli.report import exit_code_of, request_of, show_findings

if TYPE_CHECKING:
    import argparse

    from joshua.plan import NodeSpec, Plan

SUMMARY = "show what a file would start, and start nothing"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua plan``."""
    add_config_options(parser)
    add_stand_in_options(parser.add_argument_group("stand-ins"))


def run(arguments: argparse.Namespace) -> int:
    """Prints the plan as text, or as JSON with ``--format json``."""
    if not arguments.config:
        sys.stderr.write("joshua plan: no file given: add --config PATH\n")
        return ExitCode.INVALID
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    result = examine(request_of(arguments, Purpose.SHOW))
    if result.plan is None:
        show_findings(result, arguments.format)
        return exit_code_of(result)
    if arguments.format == "json":
        sys.stdout.write(result.plan.model_dump_json(indent=2) + "\n")
    else:
        show_findings(result, "text")
        sys.stdout.write(plan_text(result.plan))
    return ExitCode.OK


def plan_text(plan: Plan) -> str:
    """Prints a plan for people: one paragraph for each node, in start order."""
    transport = plan.transport
    lines = [
        f"{plan.source}: {plan.mode}, {len(plan.nodes)} nodes",
        f"transport: {transport.kind} (domain {transport.domain_id}, {transport.distro}), {transport.reason}",
    ]
    for node in plan.nodes:
        lines += ["", *node_lines(node)]
    return "\n".join(lines) + "\n"


def without_password(text: str) -> str:
    """A text with the user of every address in it hidden: plans are shown to others."""
    return re.sub(r"(?<=://)[^/@\s]+@", "***@", text)


def node_lines(node: NodeSpec) -> list[str]:
    """Prints one node: what runs, where, and its topics with type, rate and quality of service."""
    where = [f"process group {node.process_group}"] if node.process_group else []
    where += [f"host {node.host}"] if node.host else []
    where += [f"interpreter {node.interpreter}"] if node.interpreter else []
    lines = [
        f"{node.full_name} (id {node.node_id}): {node.role or node.kind.value}",
        f"  runs      {node.implementation} [{node.backend}] from {node.plugin}"
        + (f", {', '.join(where)}" if where else ""),
    ]
    for name, value in node.settings.items():
        lines.append(f"  setting   {name} = {without_password(str(value))}")
    for topic in node.publishers:
        qos = f"{topic.qos.reliability} {topic.qos.durability} {topic.qos.history} {topic.qos.depth}"
        lines.append(f"  publishes {topic.name} [{topic.type_name}] {topic.rate_hz:g} Hz, {qos}")
    for topic in node.subscriptions:
        qos = f"{topic.qos.reliability} {topic.qos.durability} {topic.qos.history} {topic.qos.depth}"
        lines.append(f"  hears     {topic.name} [{topic.type_name}] {qos}")
    return lines
