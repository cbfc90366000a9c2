"""``joshua stop``: stop a running system."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config, add_file, add_timeout
from joshua.cli.running import SYSTEM

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_file(parser, f"{SYSTEM}; needed only if several systems run")
    add_config(parser, "the same as FILE")
    add_timeout(parser, "how long to wait for the end (default 90)", 90.0)


def run(args: argparse.Namespace) -> int:
    """Ask a system to stop and wait for its end; exit code 0, 1 if it does not end, 2 if unclear which."""
    from joshua.ipc.client import CallError, RunningSystem

    try:
        system = RunningSystem.find(args.config or "")
    except CallError as error:
        if not error.allowed:
            sys.stdout.write(f"{error}\n")
            return ExitCode.OK
        sys.stderr.write(f"joshua stop: {error}:\n" + "".join(f"  {line}\n" for line in error.allowed))
        return ExitCode.INVALID
    process_id = system.info.process_id
    try:
        ended = system.stop(args.timeout)
    except CallError as error:
        sys.stderr.write(f"joshua stop: {error}. Run: kill {process_id}\n")
        return ExitCode.FAILED
    if not ended:
        sys.stderr.write(
            f"joshua stop: process {process_id} still runs {args.timeout:g} s after the request to stop. "
            f"Run `joshua status` to see why; `kill {process_id}` ends it and loses what it still writes\n"
        )
        return ExitCode.FAILED
    sys.stdout.write(f"stopped {system.info.source} (process {process_id})\n")
    return ExitCode.OK
