"""``joshua resume``: re-enable the torque of an actuator that stopped because of a fault or an e-stop."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config, add_timeout
from joshua.cli.running import SYSTEM, explain, find_node, running_systems

if TYPE_CHECKING:
    import argparse

#: A driver that has ended is started first, which takes as long as any start.
TIMEOUT_S = 45.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("node", metavar="NODE", help="name of the actuator, such as follower_arm")
    add_config(parser, f"{SYSTEM}, if several have the node")
    add_timeout(parser, "how long to wait for the device", TIMEOUT_S)


def run(args: argparse.Namespace) -> int:
    """Resume; exit code 0, 1 if no system runs, 2 if there is no such node, 4 if the device refuses."""
    from joshua.ipc.client import CallError

    try:
        system, node = find_node(args.node, running_systems(args.config or ""), "actuator")
        reply = system.call(node, "resume", timeout_s=args.timeout, start=True)
    except CallError as error:
        code = explain("resume", error)
        return code if error.code in ("unreachable", "unknown-node") else ExitCode.HARDWARE
    sys.stdout.write(f"{reply.get('text')}\n")
    return ExitCode.OK
