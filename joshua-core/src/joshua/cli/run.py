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

if TYPE_CHECKING:
    import argparse

    from joshua.cli.emulation import EmulatedRig
    from joshua.plan import Plan, RunReport
    from joshua.planner.pipeline import Checked, PipelineResult
    from joshua.plugins.emulator import Coupling
    from joshua.supervisor.fork_server import ForkServer


def run(arguments: argparse.Namespace) -> int:
    """Runs one configuration from the check to the last report and returns the exit code."""
    began_s = time.monotonic()
    if arguments.faults and not arguments.emulate:
        return without_effect(FAULT_ALONE)
    # First of all: the fork server must be forked before any thread or transport exists, and it loads
    # the heavy modules while this process reads the file.
    from joshua.ipc.run_bases import base_directory
    from joshua.supervisor import fork_server
    from joshua.supervisor.starting import starting

    with ExitStack() as stack:
        stack.enter_context(interruptible())
        server = fork_server.start()
        stack.callback(server.close)
        stack.enter_context(starting(base_directory(os.environ)))
        from joshua.planner.pipeline import finish

        checked = check(arguments)
        if arguments.open and not runs_itself(checked) and not checked.result.errors:
            return without_effect("--open shows the page of a calibration, and this file's mode is another")
        rig = None
        if not checked.result.errors:
            prepared = stand_ins(checked, arguments, stack)
            if isinstance(prepared, int):
                return prepared
            checked, rig = prepared
        if program := runs_itself(checked):
            return run_mode(program, checked, arguments, rig)
        result = finish(checked)
        if result.plan is None:
            return refuse(result, arguments)
        report = supervise(result.plan, server, arguments, began_s)
    return conclude(result.plan, report)


@contextmanager
def interruptible() -> Iterator[None]:
    """Lets SIGTERM and SIGHUP do what Ctrl-C does, so that what has been started is tidied up.

    Only the first one: the supervisor takes the signals for the time of the run, and a second one must not
    break the tidying up off.
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


def without_effect(problem: str) -> int:
    """Refuses an option that would do nothing in this run."""
    sys.stderr.write(f"joshua: error: {problem}\nnothing was started\n")
    return ExitCode.INVALID


def check(arguments: argparse.Namespace) -> Checked:
    """Loads and checks the file."""
    from joshua.cli.report import request_of
    from joshua.planner.pipeline import check_file
    from joshua.planner.request import Purpose

    return check_file(request_of(arguments, Purpose.LAUNCH))


def stand_ins(
    checked: Checked, arguments: argparse.Namespace, stack: ExitStack
) -> tuple[Checked, EmulatedRig | None] | int:
    """Starts what ``--sim`` and ``--emulate`` put in place of devices; an exit code where that is refused."""
    links: dict[str, Coupling] = {}
    if arguments.sim:
        from joshua.cli.simulation import start_simulation

        simulated = start_simulation(checked, stack)
        if isinstance(simulated, int):
            return simulated
        checked, links = simulated
    if not arguments.emulate:
        return checked, None
    from joshua.cli.emulation import start_rig

    return start_rig(checked, arguments, stack, links)


def runs_itself(checked: Checked) -> str:
    """What runs the file's mode where no node is started, such as a calibration; "" for a run of nodes."""
    from joshua.modes import mode_of

    return mode_of(checked.loaded.config, checked.registry).run


def run_mode(program: str, checked: Checked, arguments: argparse.Namespace, rig: EmulatedRig | None) -> int:
    """Runs a mode that starts no node."""
    from joshua.plugins.targets import TargetError, load_target

    try:
        return int(load_target(program)(checked, arguments, rig))
    except TargetError as error:
        sys.stderr.write(f"joshua: error: the mode's plugin is broken: {error}\nnothing was started\n")
        return ExitCode.NOT_INSTALLED


def refuse(result: PipelineResult, arguments: argparse.Namespace) -> int:
    """Shows every finding and says that nothing was started."""
    from joshua.cli.report import exit_code_of, show_findings

    show_findings(result, arguments.format)
    sys.stderr.write("nothing was started\n")
    return exit_code_of(result)


def supervise(plan: Plan, server: ForkServer, arguments: argparse.Namespace, began_s: float) -> RunReport:
    """Starts the nodes and watches them until the end of the run."""
    from joshua.supervisor.options import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor
    from joshua.supervisor.terminal import Terminal

    level = logging.getLevelName(arguments.log_level)
    options = SupervisorOptions(log_level=level, began_s=began_s)
    return Supervisor(plan, server, options, Terminal(level)).run()


def conclude(plan: Plan, report: RunReport) -> int:
    """Names the exit code of a run; MODE_TEST prints its table, and a failed check is a failed run."""
    if not report.judged:
        return report.exit_code
    from joshua.modes.test import passed, verdict, verdict_text

    rows = verdict(plan, report)
    sys.stdout.write(verdict_text(rows, report))
    draw(report)
    return report.exit_code or (ExitCode.OK if passed(rows) else ExitCode.FAILED)


def draw(report: RunReport) -> None:
    """Writes how the joints moved, and names the files; a test that cannot be written counts all the same."""
    if not any(node.traces for node in report.nodes):
        return
    from joshua.cli.motion_report import write_reports

    try:
        for line in write_reports(report):
            sys.stdout.write(f"{line}\n")
    except OSError as error:
        reason = error.strerror or error
        sys.stderr.write(
            f"no figures of the test could be written beside {report.log}: {reason}\n"
            "set JOSHUA_LOG_DIR to a folder that can be written\n"
        )
