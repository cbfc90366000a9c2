"""``joshua task``: tell the model of a running system what to do."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode, add_config, add_timeout

from joshua_inference.running import find_model, refused

if TYPE_CHECKING:
    import argparse

SUMMARY = "tell the model of a running system what to do, in plain words"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("text", metavar="TEXT", help='what to do, such as "Put the red cube into the box."')
    parser.add_argument("--node", metavar="NODE", default="", help="name of the model, if several run")
    add_config(parser, "configuration or process id, as `joshua status` shows it, if several have a model")
    add_timeout(parser, "how long to wait for the model (default 10)", 10.0)


def run(args: argparse.Namespace) -> int:
    """Send the task; exit code 0, 1 if no system runs or the model refuses, 2 for a wrong command line."""
    from joshua.tools import CallError

    try:
        system, node = find_model(args.node, args.config or "")
        reply = system.call(node, "task", {"text": args.text}, timeout_s=args.timeout)
    except CallError as error:
        return refused("task", error)
    sys.stdout.write(f"{reply.get('text')}\n")
    return ExitCode.OK
