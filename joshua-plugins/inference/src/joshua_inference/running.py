"""Find the model of a running system that a command addresses."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.tools import ExitCode

if TYPE_CHECKING:
    from joshua.tools import CallError, RunningSystem


def refused(command: str, error: CallError) -> ExitCode:
    """Print why a model was not reached or refused. Returns the exit code."""
    lines = [f"joshua {command}: {error}"]
    lines += [f"  allowed: {', '.join(error.allowed)}"] if error.allowed else []
    sys.stderr.write("\n".join(lines) + "\n")
    return ExitCode.INVALID if error.code in ("unknown-node", "invalid") else ExitCode.FAILED


def find_model(word: str, config: str) -> tuple[RunningSystem, str]:
    """Return the system of a model and the name of its node.

    Args:
        word: name of the node, "" for the only one; config: file or process id, "" for any.

    Raises:
        CallError: no model runs, none has the name, or several do.
    """
    from joshua.tools import CallError, RunningSystem, is_named

    systems = [RunningSystem.find(config)] if config else RunningSystem.all()
    if not systems:
        raise CallError("unreachable", "no system is running. Start one: joshua --config FILE")
    models, starting = [], None
    for system, name in [(one, name) for one in systems for name in one.info.nodes]:
        try:
            if {"task", "unload"} <= {verb.name for verb in system.verbs(name)}:
                models.append((system, name))
        except CallError as error:  # an arm that restarts must not keep a person from ending an episode
            starting = error
    names = [name for _, name in models]
    found = [(system, name) for system, name in models if not word or is_named(name, word)]
    if len(found) == 1:
        return found[0]
    if not models and starting is not None:
        raise starting
    if not models:
        raise CallError("unknown-node", "no running system has a model; the mode is MODE_INFERENCE")
    problem = f"no model is named {word!r}" if word and not found else "several models run: give --node NODE"
    raise CallError("unknown-node", problem, names)
