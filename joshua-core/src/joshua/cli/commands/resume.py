"""``joshua resume``: give torque again to an actuator that stopped by a fault or an e-stop."""

from __future__ import annotations

import argparse
import difflib
import os
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
    from joshua.supervisor.control_server import ask
    from joshua.supervisor.run_directory import SOCKET_NAME, user_systems

    systems = user_systems(os.environ)
    if not systems:
        sys.stderr.write("joshua resume: nothing runs: joshua --config FILE energises the arms of a file\n")
        return ExitCode.FAILED
    found = [
        (path, info, name) for path, info in systems for name in info.actuators if _is_named(name, args.node)
    ]
    if len(found) != 1:
        _say_which(args.node, [name for _, info in systems for name in info.actuators], several=bool(found))
        return ExitCode.INVALID
    path, info, node = found[0]
    try:
        answer = ask(path / SOCKET_NAME, {"request": "resume", "node": node}, args.timeout)
    except (OSError, ValueError) as error:
        sys.stderr.write(
            f"joshua resume: process {info.process_id}, which runs {info.source}, does not answer: {error}; "
            "see joshua status\n"
        )
        return ExitCode.FAILED
    text = str(answer.get("text") or answer.get("error") or "an answer that this version does not know")
    if answer.get("resumed"):
        sys.stdout.write(f"{text}\n")
        return ExitCode.OK
    sys.stderr.write(f"joshua resume: refused: {text}\n")
    return ExitCode.HARDWARE


def _is_named(full_name: str, word: str) -> bool:
    return word in (full_name, full_name.lstrip("/"), full_name.rpartition("/")[2])


def _say_which(word: str, known: list[str], *, several: bool) -> None:
    lines = [f"joshua resume: {'several actuators are' if several else 'no actuator is'} called {word!r}"]
    near = difflib.get_close_matches(word.lstrip("/"), [name.lstrip("/") for name in known], n=1)
    if near and not several:
        lines.append(f"  nearest: {near[0]}")
    lines.append(f"  allowed: {', '.join(known) or 'none: no running system has an actuator'}")
    sys.stderr.write("\n".join(lines) + "\n")
