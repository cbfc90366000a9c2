"""``joshua --config PATH``: check a file, start its nodes, watch them, stop them."""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
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
    from joshua.plan.events import Event
    from joshua.planner.pipeline import Checked
    from joshua.supervisor.fork_server import ForkServer


def run(arguments: argparse.Namespace) -> int:
    """Run one configuration from the check to the last report and return the exit code."""
    began_s = time.monotonic()
    with interruptible() as interrupts:
        ended: list[Plan] = []
        try:
            code = _run_to_end(arguments, interrupts, began_s, ended)
        except KeyboardInterrupt:
            code = ExitCode.INTERRUPTED
        interrupts.ignored = True
        show_torque(arguments, code, ended)
        return code


def show_torque(arguments: argparse.Namespace, code: int, ended: Sequence[Plan]) -> None:
    """Print as the last line what the actuators of the file do after the run, and what to do about it.

    Args:
        code: exit code of the run; ended: its plan, if it has started its nodes.
    """
    from joshua.cli.energised import AFTER_RUN_S, left_energised, left_lines
    from joshua.ipc.run_bases import base_directories

    if not arguments.config:
        return
    source = os.path.abspath(arguments.config)  # noqa: PTH100 (links stay as they are)
    left = left_energised(base_directories(os.environ), lambda record: record.source == source, AFTER_RUN_S)
    lines = left_lines(left)
    was_interrupted_early = code == ExitCode.INTERRUPTED and not ended
    if not lines and not arguments.emulate and (was_interrupted_early or any(map(_outlives_run, ended))):
        lines = [f"this run left no torque on{_next_step(arguments, source, code, ended)}"]
    stream = sys.stderr if arguments.format == "json" else sys.stdout  # where findings are a document
    stream.writelines(f"{line}\n" for line in lines)


def _next_step(arguments: argparse.Namespace, source: str, code: int, ended: Sequence[Plan]) -> str:
    """What to do after a run that left no torque on, with one command; "" after an ordinary end."""
    from joshua.cli.energised import plan_options, shown_command

    options = plan_options(arguments)
    if any(map(_is_latched, ended)):
        return ", and the e-stop stays latched; look at the robot, then: joshua estop --release"
    if code == ExitCode.INTERRUPTED:
        return f"; to start it again: {shown_command('--config', source, options)}"
    if code not in (ExitCode.OK, ExitCode.INVALID):
        return f"; to check its devices: {shown_command('doctor', source, options)}"
    return ""


def _is_latched(plan: Plan) -> bool:
    """Whether an e-stop keeps torque off an actuator of a plan."""
    from joshua.guardian.latch import LatchFolder, Subject, latch_folder
    from joshua.ipc.run_bases import base_directories

    domain_id = plan.transport.domain_id
    subjects = [Subject(plan.robot_id, domain_id, spec.full_name) for spec in plan.nodes]
    folders = [LatchFolder(latch_folder(base)) for base in base_directories(os.environ)]
    return any(folder.standing(subject) is not None for folder in folders for subject in subjects)


def _outlives_run(plan: Plan) -> bool:
    """Whether a plan has an actuator that can keep its torque after the run."""
    from joshua.plan import ActuatorFacts

    facts = [spec.facts for spec in plan.nodes if isinstance(spec.facts, ActuatorFacts)]
    real = [item for item in facts if item.simulation is None and not item.dry_run]
    return any(item.estop_action or item.keeps_last_goal for item in real)


def _run_to_end(
    arguments: argparse.Namespace, interrupts: Interrupts, began_s: float, ended: list[Plan]
) -> int:
    """Run a configuration. Interrupted before or after the run, it has cleaned up everything."""
    try:
        if arguments.faults and not arguments.emulate:
            raise NotStartedError(FAULT_ALONE)
        # First, because the fork server must be forked before any thread or transport exists, and loads the
        # heavy modules while this process reads the file.
        from joshua.ipc.run_bases import base_directory
        from joshua.supervisor import fork_server
        from joshua.supervisor.starting import starting

        with ExitStack() as stack:
            server = fork_server.start()
            stack.callback(server.close)
            stack.enter_context(starting(base_directory(os.environ)))
            return _run(arguments, server, stack, began_s, interrupts, ended)
    except NotStartedError as error:
        return error.show()


def _run(
    arguments: argparse.Namespace,
    server: ForkServer,
    stack: ExitStack,
    began_s: float,
    interrupts: Interrupts,
    ended: list[Plan],
) -> int:
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
    report = supervise(result.plan, server, arguments, began_s, interrupts)
    if report.nodes:
        ended.append(result.plan)
    stack.close()  # before the verdict, which may take a second to draw
    return conclude(result.plan, report)


class Interrupts:
    """What signals do outside the run, during which the supervisor handles them.

    Attributes:
        ignored: whether the run is over. A late Ctrl-C must not cut off the last lines.
    """

    def __init__(self) -> None:
        self.ignored = False
        self._former: dict[int, Any] = {}

    def install(self) -> None:
        """Handle SIGTERM and SIGHUP like Ctrl-C."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._former[number] = signal.signal(number, self._interrupt)

    def close(self) -> None:
        """Restore the former handlers."""
        while self._former:
            signal.signal(*self._former.popitem())

    def _interrupt(self, _number: int, _frame: object) -> None:
        if self.ignored:
            return
        for other in (signal.SIGTERM, signal.SIGHUP):  # which must not interrupt the clean-up
            signal.signal(other, signal.SIG_IGN)
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[Interrupts]:
    """Handle SIGTERM and SIGHUP like Ctrl-C, so that everything started is cleaned up."""
    interrupts = Interrupts()
    interrupts.install()
    try:
        yield interrupts
    finally:
        interrupts.close()


def run_mode(program: str, checked: Checked, arguments: argparse.Namespace, rig: EmulatedRig | None) -> int:
    """Run a mode that starts no node, such as a calibration."""
    from joshua.plugins.targets import TargetError, load_target

    try:
        return int(load_target(program)(checked, arguments, rig))
    except TargetError as error:
        raise NotStartedError(f"the mode's plugin is broken: {error}", ExitCode.NOT_INSTALLED) from error


def supervise(
    plan: Plan, server: ForkServer, arguments: argparse.Namespace, began_s: float, interrupts: Interrupts
) -> RunReport:
    """Start the nodes and watch them until the end of the run. Signals are then ignored."""
    from joshua.cli.energised import plan_options
    from joshua.plan import RunReport
    from joshua.supervisor.policies import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor
    from joshua.supervisor.terminal import Terminal

    level = logging.getLevelName(arguments.log_level)
    options = SupervisorOptions(
        log_level=level,
        duration_s=arguments.duration,
        start_timeout_s=arguments.start_timeout,
        began_s=began_s,
        devices_outlive_run=not arguments.emulate,
        plan_options=plan_options(arguments),
    )
    terminal = Terminal(level)

    def show(event: Event) -> None:
        if isinstance(event, RunReport):
            interrupts.ignored = True
        terminal(event)

    return Supervisor(plan, server, options, show).run()


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
