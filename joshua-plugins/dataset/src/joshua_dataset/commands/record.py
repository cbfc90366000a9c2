"""``joshua record``: start, stop, keep and discard episodes of a running recorder, by command or by key."""

from __future__ import annotations

import argparse
import shutil
import sys
from functools import partial
from typing import TYPE_CHECKING, Any

from joshua.tools import positive_seconds

if TYPE_CHECKING:
    from joshua.tools import RunningSystem

SUMMARY = "control the episodes of a running recorder; without an action, with keys and a live screen"

NODE = "/data_store"

ACTIONS = {
    "start": "start an episode; a stopped one is kept",
    "stop": "end the episode; then keep or discard it",
    "keep": "keep the episode; one that is being recorded ends first",
    "discard": "discard the episode that is being recorded or was stopped",
    "rerecord": "discard the episode and record it again",
    "task": "record another task from the next episode on",
    "status": "show what the recorder is doing",
}

KEYS = {" ": "", "s": "start", "e": "stop", "k": "keep", "d": "discard", "r": "rerecord", "t": "task"}
HELP = "space start/stop  k keep  d discard  r record again  t next task  q leave"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions and options of ``joshua record``."""
    parser.add_argument(
        "action", nargs="?", choices=tuple(ACTIONS), metavar="ACTION", help=", ".join(ACTIONS)
    )
    parser.add_argument(
        "text", nargs="?", default="", help="text of the task (default: the next task of the file)"
    )
    parser.add_argument("--system", default="", help="file or process id, if several recorders run")
    parser.add_argument(
        "--timeout", type=positive_seconds, default=30.0, metavar="SECONDS", help="how long to wait"
    )
    parser.epilog = "\n".join(f"{name}: {text}" for name, text in ACTIONS.items())


def run(arguments: argparse.Namespace) -> int:
    """Send a request to the recorder. Exit code 0; 1 if it refuses, or no recorder runs."""
    from joshua.tools import CallError, ExitCode

    if arguments.text and arguments.action != "task":
        sys.stderr.write(f"joshua record {arguments.action or ''}: only `task` takes a text\n")
        return ExitCode.INVALID
    try:
        system = _system(arguments.system)
        if arguments.action is None:
            return _interactive(system, arguments.timeout)
        if arguments.action == "status":
            sys.stdout.write(screen(_status(system), shutil.get_terminal_size().columns) + "\n")
            return ExitCode.OK
        payload = {"text": arguments.text} if arguments.action == "task" else {}
        reply = system.call(NODE, arguments.action, payload, timeout_s=arguments.timeout)
    except CallError as error:
        sys.stderr.write(f"joshua record: {error}\n")
        return ExitCode.FAILED
    sys.stdout.write(f"{reply['text']}\n")
    return ExitCode.OK


def _system(word: str) -> RunningSystem:
    from joshua.tools import CallError, RunningSystem

    systems = [RunningSystem.find(word)] if word else RunningSystem.all()
    systems = [item for item in systems if item.has(NODE)]
    if len(systems) != 1:
        raise CallError(
            "unknown-node",
            "several recorders run: name one with --system FILE"
            if systems
            else "no recorder is running: start a file with a data_store block, then run this in another "
            "terminal",
        )
    return systems[0]


def _status(system: RunningSystem) -> dict[str, Any]:
    return system.call(NODE, "status", {}, timeout_s=5.0)


def screen(status: dict[str, Any], width: int) -> str:
    """Describe the state of a recorder in lines of at most ``width`` columns."""
    wanted = f" of {status['wanted']}" if status["wanted"] else ""
    left = f", {status['remaining_s']:.0f} s left" if status["remaining_s"] else ""
    lines = [
        f"episode {status['episode']}  {status['phase']}  {status['elapsed_s']:.0f} s{left}",
        f"task: {status['task'] or 'none'}",
        f"kept in this run: {status['kept']}{wanted}   frames: {status['frames']}   "
        f"dropped: {status['dropped']}   held: {status['held']}",
        f"worst alignment: {status['worst_alignment_s'] * 1000:.1f} ms   queue: {status['queue_s']:.1f} s   "
        f"encoders: {status['encoder_load'] * 100:.0f} %",
        f"disk: {status['free_bytes'] / 1e9:.1f} GB left   {status['folder']}",
    ]
    for key, rate in status["rates_hz"].items():
        note = (
            "   no message"
            if not rate
            else ("   missing in the last frame" if key in status["missing"] else "")
        )
        delay_s = status.get("delays_s", {}).get(key, 0.0)
        late = f"   {delay_s * 1000:5.0f} ms old" if rate and abs(delay_s) >= 0.001 else ""
        lines.append(f"  {key:<32} {rate:6.1f} Hz{late}{note}")
    if status["message"]:
        lines.append(status["message"])
    return "\n".join(line[:width] for line in lines)


def _interactive(system: RunningSystem, timeout_s: float) -> int:
    from joshua.tools import key_screen

    status: dict[str, Any] = {}

    def shown(width: int) -> str:
        status.update(_status(system))
        return screen(status, width)

    def ask(action: str) -> str:
        action = action or ("stop" if status["phase"] in ("recording", "warm-up") else "start")
        return str(system.call(NODE, action, {}, timeout_s=timeout_s)["text"])

    return key_screen("record start", shown, {key: partial(ask, name) for key, name in KEYS.items()}, HELP)
