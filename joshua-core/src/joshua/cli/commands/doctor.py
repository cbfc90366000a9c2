"""``joshua doctor``: check this machine and its devices, and say how to solve each problem."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

from joshua.cli.options import add_config_options
from joshua.plan.foreign_text import raw

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from joshua.cli.doctor.host import Host
    from joshua.cli.doctor.result import DoctorResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua doctor`` and of the plugins' checks."""
    from joshua.cli.doctor.checks import installed_parts

    parser.add_argument("--no-scan", action="store_true", help="open no device and send nothing")
    for part in installed_parts():
        if hasattr(part, "add_arguments"):
            part.add_arguments(parser)
    add_config_options(parser, file="check the devices of this configuration")


def run(arguments: argparse.Namespace, host: Host | None = None) -> int:
    """Print the results. Exit code 0 without errors, else 2 (file), 3 (plugin) or 4 (hardware).

    Args:
        host: the machine to check; None for this one.
    """
    from joshua.cli.doctor.checks import installed_parts
    from joshua.cli.doctor.host import Host
    from joshua.cli.doctor.result import as_json, exit_code, lines, summary
    from joshua.supervisor.tables import Screen

    host = host or Host()
    parts = installed_parts()
    for part in parts:
        if hasattr(part, "begin") and (code := part.begin(arguments, host)) is not None:
            return int(code)
    as_text = arguments.format == "text"
    screen = Screen.of(sys.stdout)
    results = []
    for result in _results(arguments, host, parts):
        results.append(result)
        if as_text:
            raw(sys.stdout).writelines(f"{line}\n" for line in lines(result, screen))
            sys.stdout.flush()
    if as_text:
        sys.stdout.write(f"{summary(results)}\n")
    else:
        sys.stdout.write(json.dumps([as_json(result) for result in results], indent=2) + "\n")
    return exit_code(results)


def _results(arguments: argparse.Namespace, host: Host, parts: Sequence[Any]) -> Iterator[DoctorResult]:
    from joshua.cli.doctor.checks import CHECKS
    from joshua.cli.doctor.configuration import check_configuration
    from joshua.cli.report import request_of
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    def added(name: str) -> list[Any]:
        return [check for part in parts for check in getattr(part, name, ())]

    for check in (*CHECKS, *added("CHECKS")):
        yield from check(host)
    if arguments.config:
        result = examine(request_of(arguments, Purpose.SHOW))
        opens, further = not arguments.no_scan, added("NODE_CHECKS")
        yield from check_configuration(result, opens=opens, further=further)
        for check in added("PLAN_CHECKS") if result.plan is not None else ():
            yield from check(host, result.plan)
    elif not arguments.no_scan:
        for check in added("DEVICE_CHECKS"):
            yield from check(host, arguments)
