"""``joshua episode``: begin episodes of a running model and mark their success, by command or by key."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, Any

from joshua.tools import ExitCode, add_config, add_timeout

from joshua_inference.running import find_model, refused

if TYPE_CHECKING:
    import argparse

    from joshua.tools import RunningSystem

SUMMARY = "begin episodes of a running model and mark their success; without an action, with keys"

#: Verb and request of each action.
ACTIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "begin": ("begin_episode", {}),
    "success": ("end_episode", {"success": True}),
    "failure": ("end_episode", {"success": False}),
    "pause": ("pause", {}),
    "resume": ("resume", {}),
    "step": ("step", {}),
}
KEYS = {"b": "begin", "s": "success", "f": "failure", "p": "pause", "r": "resume", "n": "step"}
HELP = "b begin   s success   f failure   p pause   r resume   n one chunk   q quit (the run continues)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "action", nargs="?", choices=tuple(ACTIONS), metavar="ACTION", help=", ".join(ACTIONS)
    )
    parser.add_argument("--node", metavar="NODE", default="", help="name of the model, if several run")
    add_config(parser, "configuration or process id, as `joshua status` shows it, if several have a model")
    add_timeout(parser, "how long to wait for the model (default 10)", 10.0)


def run(args: argparse.Namespace) -> int:
    """Call the model; exit code 0, 1 if no system runs or the model refuses, 2 for a wrong command line."""
    from joshua.tools import CallError

    try:
        system, node = find_model(args.node, args.config or "")
        if args.action is None:
            return _interactive(system, node, args.timeout)
        sys.stdout.write(f"{_ask(system, node, args.action, args.timeout)}\n")
    except CallError as error:
        return refused("episode", error)
    return ExitCode.OK


def _ask(system: RunningSystem, node: str, action: str, timeout_s: float) -> str:
    verb, request = ACTIONS[action]
    return str(system.call(node, verb, request, timeout_s=timeout_s).get("text"))


def screen(node: str, figures: dict[str, Any], width: int) -> str:
    """Describe the state of a model in lines of at most ``width`` columns."""
    done, well = figures["episodes"], figures["successes"]
    share = f" ({well / done:.0%})" if done else ""
    lines = [
        f"{node}: {figures['state']}",
        f"episodes: {done}   succeeded: {well}{share}",
        f"chunks: {figures['chunks']}   model: {1e3 * figures['latency_p50_s']:.0f} ms   "
        f"age: {figures['age_p50_s']:.2f} s   skipped: {figures['skipped']}",
    ]
    return "\n".join(line[:width] for line in lines)


def _interactive(system: RunningSystem, node: str, timeout_s: float) -> int:
    from joshua.tools import key_screen

    def shown(width: int) -> str:
        return screen(node, system.call(node, "figures", {}), width)

    keys = {key: partial(_ask, system, node, action, timeout_s) for key, action in KEYS.items()}
    return key_screen("episode begin", shown, keys, HELP)
