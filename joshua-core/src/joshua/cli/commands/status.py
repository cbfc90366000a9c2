"""``joshua status``: what runs on this machine now."""

from __future__ import annotations

import argparse
import json
import os
import queue
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.ipc.client import RunningSystem
    from joshua.plan.events import Event

SUMMARY = "show the systems that run on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    parser.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="form of the output"
    )
    parser.add_argument("--watch", action="store_true", help="go on showing it, until the systems end")


def run(args: argparse.Namespace) -> int:
    """Asks every running system for its status and prints it; exit code 0, 1 if one does not answer."""
    from joshua.guardian.latch import LatchFolder
    from joshua.ipc.client import CallError, RunningSystem
    from joshua.ipc.run_bases import base_directories
    from joshua.supervisor.run_directory import latch_folder

    if args.watch:
        return watch(RunningSystem.all(), args.format)
    bases = base_directories(os.environ)
    latches = [latch for base in bases for latch in LatchFolder(latch_folder(base)).all()]
    answers: list[dict[str, Any]] = []
    failed = False
    for system in RunningSystem.all():
        try:
            answers.append(_answer(system, system.status().as_dict()))
        except CallError as error:
            sys.stderr.write(f"{error}\n")
            failed = True
    if args.format == "json":
        sys.stdout.write(json.dumps(answers, indent=2) + "\n")
    elif answers:
        sys.stdout.write("\n".join(_lines(answers)) + "\n")
    elif not failed:
        sys.stdout.write("nothing runs\n")
    if args.format == "text":
        sys.stdout.writelines(f"{text}\n" for text in dict.fromkeys(latch.text for latch in latches))
    return 1 if failed else 0


def watch(systems: list[RunningSystem], form: str) -> int:
    """Shows the events of systems until they end; exit code 0, 1 if one cannot be watched."""
    if not systems:
        sys.stdout.write("nothing runs\n" * (form == "text"))
        return 0
    events: queue.SimpleQueue[tuple[RunningSystem, Event | Exception | None]] = queue.SimpleQueue()
    for system in systems:
        threading.Thread(target=_follow, args=(system, events), daemon=True).start()
    show = _show_json if form == "json" else _Screen().show
    left, failed = len(systems), False
    try:
        while left:
            system, event = events.get()
            if event is None:
                left -= 1
            elif isinstance(event, Exception):
                sys.stderr.write(f"{event}\n")
                failed = True
            else:
                show(system, event)
                sys.stdout.flush()
    except KeyboardInterrupt:
        return 0  # this is how a user ends it
    return 1 if failed else 0


def _follow(
    system: RunningSystem, events: queue.SimpleQueue[tuple[RunningSystem, Event | Exception | None]]
) -> None:
    from joshua.ipc.client import CallError

    try:
        for event in system.events():
            events.put((system, event))
    except CallError as error:
        events.put((system, error))
    events.put((system, None))


def _show_json(system: RunningSystem, event: Event) -> None:
    from joshua.plan.events import event_record

    sys.stdout.write(json.dumps({"run": system.info.run, **event_record(event)}) + "\n")


class _Screen:
    """The status of every system, renewed in place on a terminal; line by line elsewhere."""

    def __init__(self) -> None:
        self._answers: dict[str, dict[str, Any]] = {}
        self._happened: list[str] = []

    def show(self, system: RunningSystem, event: Event) -> None:
        from joshua.plan.events import Gap, RunEvent, RunStatus
        from joshua.supervisor.tables import clean, status_line

        if isinstance(event, RunStatus):
            self._answers[system.info.run] = _answer(system, event.as_dict())
            line = status_line(event)
        elif isinstance(event, RunEvent):
            stamp = time.strftime("%H:%M:%S", time.localtime(event.time_ns // 1_000_000_000))
            line = clean(f"{stamp} {event.node or system.info.source} {event.kind}: {event.text}")
            self._happened = [*self._happened[-9:], line]
        elif isinstance(event, Gap):
            line = f"{event.dropped} events were missed: this command was too slow"
            self._happened = [*self._happened[-9:], line]
        else:
            return
        if sys.stdout.isatty():
            text = "\x1b[K\n".join([*_lines(list(self._answers.values())), "", *self._happened])
            sys.stdout.write(f"\x1b[H{text}\x1b[K\n\x1b[J")
        else:
            sys.stdout.write(f"{line}\n")


def _answer(system: RunningSystem, status: dict[str, Any]) -> dict[str, Any]:
    info = system.info
    return {"run": info.run, "since": info.since, "domain_id": info.domain_id, **status}


def _lines(answers: list[dict[str, Any]]) -> list[str]:
    from joshua.plan.events import Progress
    from joshua.supervisor.tables import clean, columns, progress_text

    lines = []
    for answer in answers:
        lines.append(
            f"{answer['source']}  {answer['mode']}  {answer['phase']} since {answer['since']}  "
            f"process {answer['process_id']}  domain {answer['domain_id']}"
        )
        rows = [("  NODE", "STATE", "PROCESS", "RESTARTS", "RATES")]
        for node in answer["nodes"]:
            rates = [f"{topic} {rate:.1f} Hz" for topic, rate in node["published_hz"].items()]
            cells = (node["state"], str(node["process_id"]), str(node["restarts"]))
            progress = [progress_text(Progress(**item)) for item in node.get("progress", ())]
            rows.append((f"  {node['full_name']}", *cells, node["reason"] or ", ".join([*progress, *rates])))
        lines += columns(rows, right=frozenset({2, 3}))
    return [clean(line) for line in lines]
