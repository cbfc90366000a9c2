"""``joshua motors``: list the motors of a bus, or give them their ids."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

SUMMARY = "list the motors of a bus, or assign ids and line speed one motor at a time"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    import argparse

    from joshua.tools import positive_seconds

    from joshua_servo.motors.target import parse_ids

    actions = parser.add_subparsers(dest="motors_action", metavar="ACTION", required=True, title="actions")
    text = "list every motor that answers, at any line speed"
    listing = actions.add_parser("list", help=text, description=text)
    listing.add_argument(
        "--port", dest="ports", metavar="PATH", action="append", default=[], help="search this port only"
    )
    listing.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="output format"
    )
    text = (
        "assign ids and line speed: you connect one motor at a time, and JOSHUA finds, sets and verifies it"
    )
    setup = actions.add_parser("setup", help="assign ids and line speed", description=text)
    setup.add_argument("--config", metavar="PATH", default="", help="configuration whose motors are set up")
    setup.add_argument("--node", metavar="NAME", default="", help="node of the configuration")
    setup.add_argument(
        "--port", metavar="PATH", default="", help="serial port; overrides the configuration's"
    )
    setup.add_argument(
        "--ids", metavar="IDS", type=parse_ids, default=(), help="ids to assign, such as 1-6 or 3,4"
    )
    setup.add_argument("--baudrate", metavar="N", type=int, default=0, help="line speed to set, bit/s")
    setup.add_argument("--kind", metavar="KIND", default="", help="kind of the motors, such as sts3215")
    setup.add_argument(
        "--yes", action="store_true", help="ask no questions: continue as soon as the next motor is connected"
    )
    setup.add_argument(
        "--timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=60.0,
        help="with --yes: how long to wait for each motor (default 60)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the chosen action."""
    if arguments.motors_action == "list":
        from joshua_servo.motors import list_command

        return list_command.run(arguments)
    from joshua_servo.motors import setup_command

    return setup_command.run(arguments)
