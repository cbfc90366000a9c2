"""The running systems that a command line selects, and the error for none or several."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from joshua.ipc.client import CallError, RunningSystem

SYSTEM = "configuration or process id, as `joshua status` shows it"

#: Errors that another command line solves.
_INVALID = ("unknown-node", "unknown-verb", "invalid")


def running_systems(word: str = "") -> list[RunningSystem]:
    """The running systems, or the one of a file or process id. Raises CallError if there is none."""
    from joshua.ipc.client import CallError, RunningSystem

    if word:
        return [RunningSystem.find(word)]
    systems = RunningSystem.all()
    if not systems:
        raise CallError("unreachable", "no system is running. Start one: joshua --config FILE")
    return systems


def find_node(word: str, systems: list[RunningSystem], kind: str = "node") -> tuple[RunningSystem, str]:
    """The system and full name of a node.

    Args:
        word: of the user; kind: ``actuator`` searches only these.

    Raises:
        CallError: no node has that name, or several have.
    """
    from joshua.ipc.client import CallError, is_named

    nodes = [
        (system, name)
        for system in systems
        for name in (system.info.actuators if kind == "actuator" else system.info.nodes)
    ]
    found = [(system, name) for system, name in nodes if is_named(name, word)]
    if len(found) == 1:
        return found[0]
    names = [name for _, name in nodes]
    if found:
        problem = f"several {kind}s are named {word!r}: give the full name, or --config FILE"
    elif names:
        problem = f"no {kind} is named {word!r}"
        short = {name.lstrip("/"): name for name in names}
        near = difflib.get_close_matches(word.lstrip("/"), short, n=1)
        names.sort(key=lambda name: name not in [short[match] for match in near])
    else:
        problem = f"no running system has an {kind}"
    raise CallError("unknown-node", problem, names)


def explain(command: str, error: CallError) -> ExitCode:
    """Print on standard error why a call failed and what is allowed. Returns the exit code."""
    lines = [f"joshua {command}: {error}"] + [f"  allowed: {', '.join(error.allowed)}"] * bool(error.allowed)
    sys.stderr.write("\n".join(lines) + "\n")
    return ExitCode.INVALID if error.code in _INVALID else ExitCode.FAILED


def node_that_holds(processes: Iterable[int]) -> str:
    """Name the node of a running system among some processes, and the remedy; "" if there is none."""
    wanted = set(processes)
    if not wanted:
        return ""
    from joshua.ipc.client import CallError, RunningSystem

    for system in RunningSystem.all():
        try:
            nodes = system.status().nodes
        except CallError:
            continue  # it is ending or does not respond; its process is named anyway
        for node in nodes:
            if node.process_id in wanted:
                return (
                    f"in use by {node.full_name} of {system.info.source}: "
                    f"run `joshua stop` to end it (process {system.info.process_id})"
                )
    return ""
