"""``joshua status``: what runs on this machine now."""

from __future__ import annotations

import argparse
import json
import os
import sys
from typing import Any

SUMMARY = "show the systems that run on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    parser.add_argument(
        "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="form of the output"
    )


def run(args: argparse.Namespace) -> int:
    """Asks every running system for its status and prints it; exit code 0, 1 if one does not answer."""
    from joshua.guardian.latch import LatchFolder
    from joshua.ipc.client import CallError, RunningSystem
    from joshua.ipc.run_bases import base_directories
    from joshua.supervisor.run_directory import latch_folder

    bases = base_directories(os.environ)
    latches = [latch for base in bases for latch in LatchFolder(latch_folder(base)).all()]
    answers: list[dict[str, Any]] = []
    failed = False
    for system in RunningSystem.all():
        info = system.info
        try:
            status = system.status()
        except CallError as error:
            sys.stderr.write(f"{error}\n")
            failed = True
            continue
        answers.append({"run": info.run, "since": info.since, "domain_id": info.domain_id, **status})
    if args.format == "json":
        sys.stdout.write(json.dumps(answers, indent=2) + "\n")
    elif answers:
        sys.stdout.write("\n".join(_lines(answers)) + "\n")
    elif not failed:
        sys.stdout.write("nothing runs\n")
    if args.format == "text":
        sys.stdout.writelines(f"{text}\n" for text in dict.fromkeys(latch.text for latch in latches))
    return 1 if failed else 0


def _lines(answers: list[dict[str, Any]]) -> list[str]:
    from joshua.supervisor.tables import clean, columns

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
            rows.append((f"  {node['full_name']}", *cells, node["reason"] or ", ".join(rates)))
        lines += columns(rows, right=frozenset({2, 3}))
    return [clean(line) for line in lines]
