"""``joshua stop``: end running systems in good order."""

from __future__ import annotations

import argparse
import sys

from joshua.cli.options import positive_seconds

SUMMARY = "stop the systems that run on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the command."""
    parser.add_argument(
        "system",
        nargs="?",
        default="",
        metavar="SYSTEM",
        help="file or process id as `joshua status` shows it; needed only where several systems run",
    )
    parser.add_argument(
        "--timeout",
        type=positive_seconds,
        default=15.0,
        metavar="SECONDS",
        help="how long to wait for the end",
    )


def run(args: argparse.Namespace) -> int:
    """Asks a system to stop and waits for its end; exit code 0, 1 if it goes on, 2 if unclear which."""
    from joshua.ipc.client import CallError, RunningSystem

    try:
        system = RunningSystem.find(args.system)
    except CallError as error:
        if not error.allowed:
            sys.stdout.write(f"{error}\n")
            return 0
        sys.stderr.write(f"joshua stop: {error}:\n" + "".join(f"  {line}\n" for line in error.allowed))
        return 2
    process_id = system.info.process_id
    try:
        ended = system.stop(args.timeout)
    except CallError as error:
        sys.stderr.write(f"{error}; kill {process_id}\n")
        return 1
    if not ended:
        sys.stderr.write(
            f"process {process_id} was asked to stop and still runs after {args.timeout:g} s: "
            f"see `joshua status`, then kill {process_id}\n"
        )
        return 1
    sys.stdout.write(f"stopped {system.info.source} (process {process_id})\n")
    return 0
