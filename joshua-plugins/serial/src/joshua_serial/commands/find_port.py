"""``joshua find-port``: list the USB serial adapters of this machine and the motors that reply there."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua_serial.ports.survey import Families, PortSurvey
    from joshua_serial.usb_ports import PortEntry

SUMMARY = "list the USB serial adapters of this machine and the motors that answer there"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua find-port``."""
    import argparse

    parser.add_argument(
        "--port",
        dest="ports",
        metavar="PATH",
        action="append",
        default=[],
        help="search this port only; it need not be a USB adapter",
    )
    parser.add_argument(
        "--no-scan",
        action="store_true",
        help="send nothing to the ports, such as to devices that are not servos",
    )
    parser.add_argument(
        "--unplug",
        action="store_true",
        help="identify the adapter of one arm by unplugging it and plugging it back in",
    )
    parser.add_argument(
        "--write",
        dest="write_to",
        metavar="CONFIG",
        default="",
        help="write the persistent identity of the adapters into a configuration",
    )
    parser.add_argument(
        "--node", metavar="NAME", default="", help="with --write: the node that uses the adapter"
    )
    parser.add_argument(
        "--show-only", action="store_true", help="with --write: show the change, but write nothing"
    )
    parser.add_argument("--format", choices=("text", "json"), default=argparse.SUPPRESS, help="output format")


def run(arguments: argparse.Namespace, device_root: str = "/") -> int:
    """Print the ports. Exit code 0; 4 if there is none or a named port cannot be used.

    Args:
        device_root: folder that holds ``dev`` and ``sys``: ``/`` for the host's own devices.
    """
    from joshua_serial.ports.survey import chosen_ports

    if not arguments.write_to and (arguments.node or arguments.show_only):
        option = "--node" if arguments.node else "--show-only"
        sys.stderr.write(f"joshua find-port: {option} has no effect without --write CONFIG: add it\n")
        return ExitCode.INVALID
    if arguments.unplug:
        from joshua_serial.ports.unplug import NothingHappened, find_by_unplugging

        try:
            arguments.ports = [find_by_unplugging(device_root).path]
        except NothingHappened as error:
            sys.stderr.write(f"joshua find-port: {error}\n")
            return ExitCode.HARDWARE
    entries = chosen_ports(arguments.ports, device_root)
    if arguments.write_to:
        from joshua_serial.ports.write_command import write

        return write(arguments, entries, device_root)
    found = _look(entries, arguments, device_root)
    if any(item.problem for item in found) and arguments.ports:
        return ExitCode.HARDWARE
    return ExitCode.OK if found else ExitCode.HARDWARE


def _look(entries: list[PortEntry], arguments: argparse.Namespace, device_root: str) -> list[PortSurvey]:
    """Survey the ports and print each as soon as it is done."""
    from joshua_serial.ports.bus_plugins import installed_bus_tools
    from joshua_serial.ports.survey import survey
    from joshua_serial.ports.text import NOTHING, as_json, paragraph

    families: Families = {} if arguments.no_scan or not entries else installed_bus_tools()
    as_text = getattr(arguments, "format", "text") == "text"
    found: list[PortSurvey] = []
    for item in survey(entries, families, device_root):
        if as_text:
            sys.stdout.write(("\n" if found else "") + paragraph(item, families))
            sys.stdout.flush()
        found.append(item)
    if not as_text:
        sys.stdout.write(json.dumps([as_json(item) for item in found], indent=2) + "\n")
    elif not found:
        sys.stdout.write(NOTHING)
    return found
