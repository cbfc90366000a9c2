"""``joshua sim``: pause, step, reset and set the state of a running simulation."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from joshua.tools import positive_seconds

SUMMARY = "pause, step, reset or set the state of a running simulation"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions and options of ``joshua sim``."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, text in (
        ("pause", "pause simulated time"),
        ("resume", "resume simulated time"),
        ("reset", "reset the model to its start"),
    ):
        _add_common(actions.add_parser(name, help=text))
    step = _add_common(actions.add_parser("step", help="advance by a number of steps while paused"))
    step.add_argument("count", type=int, nargs="?", default=1, help="number of steps")
    state = _add_common(actions.add_parser("set", help="set the positions of joints, at rest"))
    state.add_argument(
        "joints", nargs="+", metavar="JOINT=RADIANS", type=_joint, help="for example gripper=0.5"
    )


def run(arguments: argparse.Namespace) -> int:
    """Call the simulator's node. Exit code 0; 1 if it refuses, or no simulation runs."""
    from joshua.tools import CallError, ExitCode, RunningSystem

    payload: dict[str, Any] = {}
    if arguments.action == "step":
        payload = {"count": arguments.count}
    elif arguments.action == "set":
        payload = {"joints": dict(arguments.joints)}
    node, name = arguments.node, "set_state" if arguments.action == "set" else arguments.action
    try:
        systems = [RunningSystem.find(arguments.config)] if arguments.config else RunningSystem.all()
        systems = [item for item in systems if item.has(node)]
        if len(systems) != 1:
            problem = f"no running system has a node {node}: run joshua status"
            problem = f"several systems have a node {node}: name one with --config" if systems else problem
            raise CallError("unknown-node", problem)
        reply = systems[0].call(node, name, payload, timeout_s=arguments.timeout)
    except CallError as error:
        sys.stderr.write(f"joshua sim: {error}\n")
        return ExitCode.FAILED
    sys.stdout.write(f"{reply['text']}\n")
    return ExitCode.OK


def _add_common(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    parser.add_argument(
        "--node", default="/simulation", metavar="NAME", help="the simulator's node (default /simulation)"
    )
    parser.add_argument(
        "--config", metavar="FILE", default="", help="configuration or process id, if several simulations run"
    )
    parser.add_argument(
        "--timeout", type=positive_seconds, default=10.0, metavar="SECONDS", help="how long to wait"
    )
    return parser


def _joint(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        if not (name and equals):
            raise ValueError
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected JOINT=RADIANS, such as gripper=0.5") from None
