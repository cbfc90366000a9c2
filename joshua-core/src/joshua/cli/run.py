"""``joshua --config PATH``: check a file, start its nodes, watch them, stop them."""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import FAULT_ALONE
from joshua.cli.report import NotStartedError, request_of
from joshua.plan.foreign_text import raw

if TYPE_CHECKING:
    import argparse

    from joshua.cli.stand_ins import EmulatedRig
    from joshua.plan import Plan, RunReport
    from joshua.planner.pipeline import Checked
    from joshua.supervisor.fork_server import ForkServer


def run(arguments: argparse.Namespace) -> int:
    """Run one configuration from the check to the last report and return the exit code."""
    began_s = time.monotonic()
    try:
        if arguments.faults and not arguments.emulate:
            raise NotStartedError(FAULT_ALONE)
        # First, because the fork server must be forked before any thread or transport exists, and loads the
        # heavy modules while this process reads the file.
        from joshua.ipc.run_bases import base_directory
        from joshua.supervisor import fork_server
        from joshua.supervisor.starting import starting

        with ExitStack() as stack:
            stack.enter_context(interruptible())
            server = fork_server.start()
            stack.callback(server.close)
            stack.enter_context(starting(base_directory(os.environ)))
            return _run(arguments, server, stack, began_s)
    except NotStartedError as error:
        return error.show()


def _run(arguments: argparse.Namespace, server: ForkServer, stack: ExitStack, began_s: float) -> int:
    from joshua.cli.stand_ins import replace_devices
    from joshua.modes import mode_of
    from joshua.planner.pipeline import check_file, finish
    from joshua.planner.request import Purpose

    checked = check_file(request_of(arguments, Purpose.LAUNCH))
    program = mode_of(checked.loaded.config, checked.registry).run
    rig = None
    if not checked.result.errors:
        if arguments.open and not program:
            raise NotStartedError(
                "--open shows the page of a calibration, but the mode of this file is another"
            )
        checked, rig = replace_devices(checked, arguments, stack)
    if program:
        return run_mode(program, checked, arguments, rig)
    result = finish(checked)
    if result.plan is None:
        raise NotStartedError.of(result, arguments.format)
    report = supervise(result.plan, server, arguments, began_s)
    stack.close()  # before the verdict, which may take a second to draw
    return conclude(result.plan, report)


@contextmanager
def interruptible() -> Iterator[None]:
    """Handle SIGTERM and SIGHUP like Ctrl-C, so that everything started is cleaned up.

    Only the first one counts: the supervisor handles the signals during the run, and a second one must not
    interrupt the clean-up.
    """

    def interrupt(_number: int, _frame: object) -> None:
        for other in former:
            signal.signal(other, signal.SIG_IGN)
        raise KeyboardInterrupt

    former: dict[int, Any] = {}
    for number in (signal.SIGTERM, signal.SIGHUP):
        former[number] = signal.signal(number, interrupt)
    try:
        yield
    finally:
        for taken, handler in former.items():
            signal.signal(taken, handler)


def run_mode(program: str, checked: Checked, arguments: argparse.Namespace, rig: EmulatedRig | None) -> int:
    """Run a mode that starts no node, such as a calibration."""
    from joshua.plugins.targets import TargetError, load_target

    try:
        return int(load_target(program)(checked, arguments, rig))
    except TargetError as error:
        raise NotStartedError(f"the mode's plugin is broken: {error}", ExitCode.NOT_INSTALLED) from error


def supervise(plan: Plan, server: ForkServer, arguments: argparse.Namespace, began_s: float) -> RunReport:
    """Start the nodes and watch them until the end of the run."""
    from joshua.supervisor.policies import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor
    from joshua.supervisor.terminal import Terminal

    level = logging.getLevelName(arguments.log_level)
    options = SupervisorOptions(
        log_level=level,
        duration_s=arguments.duration,
        start_timeout_s=arguments.start_timeout,
        began_s=began_s,
    )
    return Supervisor(plan, server, options, Terminal(level)).run()


def conclude(plan: Plan, report: RunReport) -> int:
    """Return the exit code of a run. MODE_TEST prints its table, and a failed check fails the run."""
    if not report.judged:
        return report.exit_code
    from joshua.cli.motion_report import verdict_lines
    from joshua.modes.test import passed, verdict
    from joshua.supervisor.tables import Screen

    rows = verdict(plan, report)
    raw(sys.stdout).writelines(f"{line}\n" for line in verdict_lines(rows, report, Screen.of(sys.stdout)))
    draw(report)
    return report.exit_code or (ExitCode.OK if passed(rows) else ExitCode.FAILED)


def draw(report: RunReport) -> None:
    """Write the recorded motion and print the file names. A failure to write does not fail the test."""
    if not any(node.traces for node in report.nodes):
        return
    from joshua.cli.motion_report import write_reports

    try:
        for line in write_reports(report):
            sys.stdout.write(f"{line}\n")
    except OSError as error:
        sys.stderr.write(
            f"no files of the test could be written beside {report.log}: {error.strerror or error}\n"
            "Set JOSHUA_LOG_DIR to a writable folder\n"
        )
