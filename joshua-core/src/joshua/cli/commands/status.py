"""``joshua status``: the systems that run on this machine."""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config, add_file, add_format
from joshua.cli.running import running_systems
from joshua.plan.foreign_text import printable, raw

if TYPE_CHECKING:
    import argparse

    from joshua.ipc.client import RunInfo, RunningSystem
    from joshua.plan.events import Event, RunStatus

    Item = tuple[RunningSystem, Event | Exception | None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add_file(parser, "configuration or process id; omitted shows every system")
    add_config(parser, "the same as FILE")
    add_format(parser)
    parser.add_argument("--watch", action="store_true", help="update the status until the systems end")


def run(args: argparse.Namespace) -> int:
    """Show the status of running systems; exit code 0, 1 if one does not answer or the file does not run."""
    from joshua.cli.energised import left_energised, left_lines
    from joshua.guardian.latch import LatchFolder, latch_folder
    from joshua.ipc.client import CallError
    from joshua.ipc.run_bases import base_directories

    as_json = args.format == "json"
    try:
        systems = running_systems(args.config or "")
    except CallError as error:
        if args.config:
            sys.stderr.write(f"joshua status: {error}\n" + "".join(f"  {line}\n" for line in error.allowed))
            path = os.path.abspath(args.config)  # noqa: PTH100 (links stay as they are)
            held = left_energised(base_directories(os.environ), lambda record: record.source == path)
            sys.stderr.writelines(f"{line}\n" for line in left_lines(held))
            return ExitCode.FAILED
        systems = []
    if args.watch and systems:
        return watch(systems, as_json=as_json)
    answers: list[tuple[RunInfo, RunStatus]] = []
    failed = False
    for system in systems:
        try:
            answers.append((system.info, system.status()))
        except CallError as error:
            sys.stderr.write(f"{error}\n")
            failed = True
    left = [] if args.config else left_lines(left_energised(base_directories(os.environ)))
    if as_json:
        sys.stdout.write(json.dumps([_record(*item) for item in answers], indent=2) + "\n")
        sys.stderr.writelines(f"{line}\n" for line in left)
        return ExitCode.FAILED if failed else ExitCode.OK
    raw(sys.stdout).writelines(f"{line}\n" for item in answers for line in _lines(*item))
    if not systems:
        sys.stdout.write("no system is running\n")
    folders = [LatchFolder(latch_folder(base)) for base in base_directories(os.environ)]
    latches = dict.fromkeys(latch.text for folder in folders for latch in folder.all())
    sys.stdout.writelines(f"{text}\n" for text in latches)
    sys.stdout.writelines(f"{line}\n" for line in left)
    return ExitCode.FAILED if failed else ExitCode.OK


def watch(systems: list[RunningSystem], *, as_json: bool) -> int:
    """Show the events of systems until they end; exit code 0, 1 if one cannot be watched."""
    from joshua.plan.events import event_record

    events: queue.SimpleQueue[Item] = queue.SimpleQueue()
    for system in systems:
        threading.Thread(target=_follow, args=(system, events), daemon=True).start()
    screen = _Watched()
    left, failed = len(systems), False
    try:
        while left:
            system, event = events.get()
            if event is None:
                left -= 1
            elif isinstance(event, Exception):
                sys.stderr.write(f"{event}\n")
                failed = True
            elif as_json:
                sys.stdout.write(json.dumps({"run": system.info.run, **event_record(event)}) + "\n")
            else:
                screen.show(system, event)
            sys.stdout.flush()
    except KeyboardInterrupt:
        return ExitCode.OK  # the usual way to end it
    return ExitCode.FAILED if failed else ExitCode.OK


def _follow(system: RunningSystem, events: queue.SimpleQueue[Item]) -> None:
    from joshua.ipc.client import CallError

    try:
        for event in system.events():
            events.put((system, event))
    except CallError as error:
        events.put((system, error))
    events.put((system, None))


class _Watched:
    """The status of every system, updated in place on a terminal; line by line elsewhere."""

    def __init__(self) -> None:
        self._answers: dict[str, tuple[RunInfo, RunStatus]] = {}
        self._happened: list[str] = []

    def show(self, system: RunningSystem, event: Event) -> None:
        from joshua.plan.events import Gap, RunEvent, RunStatus
        from joshua.supervisor.tables import status_lines

        lines: list[str] = []
        if isinstance(event, RunStatus):
            self._answers[system.info.run] = (system.info, event)
            lines = status_lines(event)
        elif isinstance(event, RunEvent):
            stamp = time.strftime("%H:%M:%S", time.localtime(event.time_ns // 1_000_000_000))
            lines = [printable(f"{stamp} {event.node or system.info.source} {event.kind}: {event.text}")]
        elif isinstance(event, Gap):
            lines = [f"{event.dropped} events were dropped because this command reads too slowly"]
        else:
            return
        if not isinstance(event, RunStatus):
            self._happened = [*self._happened[-9:], *lines]
        if sys.stdout.isatty():
            table = [line for item in self._answers.values() for line in _lines(*item)]
            text = "\x1b[K\n".join([*table, "", *self._happened])
            raw(sys.stdout).write(f"\x1b[H{text}\x1b[K\n\x1b[J")
        else:
            sys.stdout.write("".join(f"{line}\n" for line in lines))


def _record(info: RunInfo, status: RunStatus) -> dict[str, Any]:
    """One system for programs."""
    return {"run": info.run, "since": info.since, "domain_id": info.domain_id, **status.as_dict()}


def _lines(info: RunInfo, status: RunStatus) -> list[str]:
    """One system for people: a line for each node and each thing it reports, then the reasons of faults."""
    from joshua.supervisor.tables import Cell, Screen, columns, node_cells, state_cell

    screen = Screen.of(sys.stdout)
    lines = screen.wrap(
        f"{status.source}  {status.mode}  {status.phase} since {info.since}  "
        f"process {status.process_id}  domain {info.domain_id}"
    )
    rows: list[tuple[str, ...]] = [("  NODE", "STATE", "PROCESS", "RATES")]
    for node in status.nodes:
        again = f"[{node.restarts} restart{'s' * (node.restarts > 1)}]"
        told = [Cell(again)] * bool(node.restarts)
        if node.state == "ready":
            told += node_cells(node, full_topics=True)[1:]
        elif node.state == "fault":  # its state has a column of its own
            told += node_cells(node)[2:]
        first, *rest = told or [Cell("")]
        rows.append((f"  {node.full_name}", state_cell(node), str(node.process_id), first))
        rows += [("", "", "", cell) for cell in rest]
    lines += columns(rows, screen=screen, right=(2,), drop=(2,), flexible=3)
    for node in status.nodes:
        if text := node.reason or (node.doing if node.state != "ready" else ""):
            lines += screen.wrap(text, f"  {node.full_name}: ", state_cell(node).style, indent=4)
    return lines
