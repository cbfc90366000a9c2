"""``joshua stop``: end running systems in good order."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

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
    from joshua.supervisor.control_server import ask
    from joshua.supervisor.run_directory import SOCKET_NAME, user_systems

    systems = user_systems(os.environ)
    wanted = {args.system, os.path.abspath(args.system)}  # noqa: PTH100 (links stay as they are)
    chosen = [
        item for item in systems if not args.system or {item[1].source, str(item[1].process_id)} & wanted
    ]
    if not systems:
        sys.stdout.write("nothing runs\n")
        return 0
    if len(chosen) != 1:
        known = "\n".join(f"  {info.process_id}  {info.source}" for _, info in systems)
        problem = f"no system {args.system!r} runs" if not chosen else "several systems run, name one"
        sys.stderr.write(f"joshua stop: {problem}:\n{known}\n")
        return 2
    path, info = chosen[0]
    try:
        ask(path / SOCKET_NAME, {"request": "stop"})
    except (OSError, ValueError) as error:
        sys.stderr.write(f"process {info.process_id} does not answer: {error}; kill {info.process_id}\n")
        return 1
    if not _ended(path, args.timeout):
        sys.stderr.write(
            f"process {info.process_id} was asked to stop and still runs after {args.timeout:g} s: "
            f"see `joshua status`, then kill {info.process_id}\n"
        )
        return 1
    sys.stdout.write(f"stopped {info.source} (process {info.process_id})\n")
    return 0


def _ended(path: Path, timeout_s: float) -> bool:
    deadline_s = time.monotonic() + timeout_s
    while path.exists():
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.02)
    return True
