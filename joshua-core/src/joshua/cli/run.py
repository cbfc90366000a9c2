"""``joshua --config PATH``: check a file, start its nodes, watch them, stop them."""

from __future__ import annotations

import logging
import sys
import time
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.generator.examination import Examination
    from joshua.generator.fork_server import ForkServer
    from joshua.plan import Plan, RunReport


def run(arguments: argparse.Namespace) -> int:
    """Runs one configuration from the check to the last report and returns the exit code."""
    began_s = time.monotonic()
    # First of all: the fork server must be forked before any thread or transport exists, and it loads
    # the heavy modules while this process reads the file.
    from joshua.generator import fork_server

    server = fork_server.start()
    try:
        examination = examine(arguments)
        if examination.plan is None:
            return refuse(examination, arguments)
        report = supervise(examination.plan, server, arguments, began_s)
    finally:
        server.close()
    return conclude(examination.plan, report)


def examine(arguments: argparse.Namespace) -> Examination:
    """Loads, checks and plans the file."""
    from joshua.cli.report import request_of
    from joshua.generator.examination import examine as examine_request
    from joshua.generator.request import Purpose

    return examine_request(request_of(arguments, Purpose.LAUNCH))


def refuse(examination: Examination, arguments: argparse.Namespace) -> int:
    """Shows every finding and says that nothing was started."""
    from joshua.cli.report import exit_code_of, show_findings

    show_findings(examination, arguments.format)
    sys.stderr.write("nothing was started\n")
    return exit_code_of(examination)


def supervise(plan: Plan, server: ForkServer, arguments: argparse.Namespace, began_s: float) -> RunReport:
    """Starts the nodes and watches them until the end of the run."""
    from joshua.generator.options import SupervisorOptions
    from joshua.generator.supervisor import Supervisor
    from joshua.generator.terminal import Terminal

    level = logging.getLevelName(arguments.log_level)
    options = SupervisorOptions(log_level=level, began_s=began_s)
    return Supervisor(plan, server, options, Terminal(level)).run()


def conclude(plan: Plan, report: RunReport) -> int:
    """Names the exit code of a run; MODE_TEST prints its table, and a failed check is a failed run."""
    if plan.mode != "MODE_TEST" or report.ready_s is None:
        return report.exit_code
    from joshua.modes.verdict import passed, verdict, verdict_text

    rows = verdict(plan, report)
    sys.stdout.write(verdict_text(rows))
    return report.exit_code or (ExitCode.OK if passed(rows) else ExitCode.FAILED)
