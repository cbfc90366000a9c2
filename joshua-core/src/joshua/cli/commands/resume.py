"""``joshua resume``: give torque again to an actuator that stopped by a fault or an e-stop."""

from __future__ import annotations

import argparse
import sys

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import positive_seconds

SUMMARY = "give torque again to an actuator that stopped"

#: A driver that stays down is started again first, which takes as long as any start.
TIMEOUT_S = 45.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the command."""
    parser.add_argument("node", metavar="NODE", help="name of the actuator, such as follower_arm")
    parser.add_argument(
        "--timeout",
        type=positive_seconds,
        default=TIMEOUT_S,
        metavar="SECONDS",
        help="how long to wait for the device",
    )


def run(args: argparse.Namespace) -> int:
    """Asks the run of the node; exit code 0, 1 if nothing runs, 2 if there is no such node, 4 if refused."""
    from joshua.cli.commands.call import say_which
    from joshua.ipc.client import CallError, RunningSystem, is_named

    systems = RunningSystem.all()
    if not systems:
        sys.stderr.write("joshua resume: nothing runs: joshua --config FILE energises the arms of a file\n")
        return ExitCode.FAILED
    actuators = [(item, name) for item in systems for name in item.info.actuators]
    found = [(item, name) for item, name in actuators if is_named(name, args.node)]
    if len(found) != 1:
        say_which("resume", "actuator", args.node, [name for _, name in actuators], several=bool(found))
        return ExitCode.INVALID
    system, node = found[0]
    try:
        reply = system.call(node, "resume", timeout_s=args.timeout, start=True)
    except CallError as error:
        if error.code == "unreachable":
            sys.stderr.write(f"joshua resume: {error}; see joshua status\n")
            return ExitCode.FAILED
        sys.stderr.write(f"joshua resume: refused: {error}\n")
        return ExitCode.HARDWARE
    sys.stdout.write(f"{reply.get('text')}\n")
    return ExitCode.OK
