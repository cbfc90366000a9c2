"""``joshua doctor``: what of this machine and its devices is in order, and what to do about the rest."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from joshua.cli.doctor.finding import Finding
    from joshua.cli.doctor.host import Host
    from joshua.devices.usb_ports import PortEntry

SUMMARY = "look at this machine and its devices: what is wrong, and what to do about it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua doctor``."""
    parser.add_argument(
        "--port", dest="ports", metavar="PATH", action="append", default=[], help="look at this port only"
    )
    parser.add_argument("--no-scan", action="store_true", help="open no device and send nothing")
    parser.add_argument(
        "--udev",
        metavar="PATH",
        nargs="?",
        const="-",
        default="",
        help="print udev rules that give each adapter a lasting name, or write them to a file or folder",
    )
    add_config_options(parser)


def run(arguments: argparse.Namespace, host: Host | None = None) -> int:
    """Prints the findings. Exit code 0 without errors; else 2 (file), 3 (plugin) or 4 (hardware).

    Args:
        host: the machine to look at; None for this one.
    """
    from joshua.cli.doctor.host import Host
    from joshua.cli.doctor.text import as_json, exit_code, lines, summary

    if arguments.config and arguments.ports:
        sys.stderr.write(
            "joshua doctor: --config looks at the devices of the file, --port at a port: leave one out\n"
        )
        return ExitCode.INVALID
    host = host or Host()
    if arguments.udev:
        from joshua.cli.doctor.udev_command import write_rules

        return write_rules(arguments, host)
    as_text = arguments.format == "text"
    findings = []
    for finding in _findings(arguments, host):
        findings.append(finding)
        if as_text:
            sys.stdout.write("\n".join(lines(finding)) + "\n")
            sys.stdout.flush()
    if as_text:
        sys.stdout.write(f"{summary(findings)}\n")
    else:
        sys.stdout.write(json.dumps([as_json(finding) for finding in findings], indent=2) + "\n")
    return exit_code(findings)


def _findings(arguments: argparse.Namespace, host: Host) -> Iterator[Finding]:
    from joshua.cli.doctor.checks import CHECKS

    for check in CHECKS:
        yield from check(host)
    if arguments.config:
        yield from _of_configuration(arguments)
    elif not arguments.no_scan:
        yield from _of_ports(arguments, host)


def _of_configuration(arguments: argparse.Namespace) -> Iterator[Finding]:
    from joshua.cli.doctor.configuration import check_configuration
    from joshua.cli.report import request_of
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    examination = examine(request_of(arguments, Purpose.SHOW))
    yield from check_configuration(examination, opens=not arguments.no_scan)


def _of_ports(arguments: argparse.Namespace, host: Host) -> Iterator[Finding]:
    from joshua.cli.doctor.buses import check_buses
    from joshua.cli.ports.bus_plugins import installed_bus_tools
    from joshua.cli.ports.survey import chosen_ports

    root = str(host.root)
    entries: list[PortEntry] = chosen_ports(arguments.ports, root)
    families = installed_bus_tools()
    if entries and families:
        yield from check_buses(entries, families, root)
