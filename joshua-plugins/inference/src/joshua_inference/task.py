"""``joshua task``: tell the model of a running system what to do."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode, add_config, add_timeout

if TYPE_CHECKING:
    import argparse

    from joshua.tools import RunningSystem

SUMMARY = "tell the model of a running system what to do, in plain words"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("text", metavar="TEXT", help='what to do, such as "Put the red cube into the box."')
    parser.add_argument("--node", metavar="NODE", default="", help="name of the model, if several run")
    add_config(parser, "configuration or process id, as `joshua status` shows it, if several have a model")
    add_timeout(parser, "how long to wait for the model (default 10)", 10.0)


def run(args: argparse.Namespace) -> int:
    """Give the task; exit code 0, 1 if no system runs or the model refuses, 2 for a wrong command line."""
    from joshua.tools import CallError

    try:
        system, node = _model(args.node, args.config or "")
        reply = system.call(node, "task", {"text": args.text}, timeout_s=args.timeout)
    except CallError as error:
        lines = [f"joshua task: {error}"] + [f"  allowed: {', '.join(error.allowed)}"] * bool(error.allowed)
        sys.stderr.write("\n".join(lines) + "\n")
        return ExitCode.INVALID if error.code in ("unknown-node", "invalid") else ExitCode.FAILED
    sys.stdout.write(f"{reply.get('text')}\n")
    return ExitCode.OK


def _model(word: str, config: str) -> tuple[RunningSystem, str]:
    """The model that is meant, and its system. Raises CallError."""
    from joshua.tools import CallError, RunningSystem, is_named

    systems = [RunningSystem.find(config)] if config else RunningSystem.all()
    if not systems:
        raise CallError("unreachable", "no system is running. Start one: joshua --config FILE")
    models = [
        (system, name)
        for system in systems
        for name in system.info.nodes
        if {"task", "unload"} <= {verb.name for verb in system.verbs(name)}
    ]
    names = [name for _, name in models]
    found = [(system, name) for system, name in models if not word or is_named(name, word)]
    if len(found) == 1:
        return found[0]
    if not models:
        raise CallError("unknown-node", "no running system has a model; the mode is MODE_INFERENCE")
    problem = f"no model is named {word!r}" if word and not found else "several models run: give --node NODE"
    raise CallError("unknown-node", problem, names)
