"""The supervisor: starts, watches and stops the processes of a plan.

Why one file: one state machine, the phases of a run. Every part reads or changes the phase.
"""

from __future__ import annotations

import logging
import os
import signal
import time
import traceback
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

from joshua.guardian.drop_order import DropOrder
from joshua.ipc import messages as ipc
from joshua.ipc.run_bases import MAX_PATH_BYTES, RunDirectoryError, short_base_directory
from joshua.plan import NodeKind, NodeSpec, Plan, RunFacts, RunReport
from joshua.plan.events import RunEvent, RunStatus
from joshua.plan.report import without_reasons
from joshua.supervisor.fork_server import ForkServer
from joshua.supervisor.heartbeats import CHECK_PERIOD_S
from joshua.supervisor.launcher import Launcher
from joshua.supervisor.log_files import new_log
from joshua.supervisor.logbook import Logbook, Subscriber
from joshua.supervisor.managed_process import Change, ManagedProcess
from joshua.supervisor.node_record import NodeRecord, priority_notes, run_status, start_table
from joshua.supervisor.policies import SupervisorOptions
from joshua.supervisor.reactor import Reactor, StopSignals
from joshua.supervisor.repeated_stop import Press, RepeatedStop, StopNotice
from joshua.supervisor.run_directory import (
    LINK_FOLDER,
    NodesInUseError,
    RunDirectory,
    RunPlace,
    socket_folder,
)
from joshua.supervisor.run_requests import RunRequests
from joshua.supervisor.terminal_guard import TerminalGuard


def process_groups(nodes: Sequence[NodeSpec]) -> list[tuple[NodeSpec, ...]]:
    """Splits nodes into processes, in start order. A group starts in place of its first node."""
    groups: dict[tuple[str, str], list[NodeSpec]] = {}
    for spec in nodes:
        key = ("group", spec.process_group) if spec.process_group else ("node", spec.full_name)
        groups.setdefault(key, []).append(spec)
    return [tuple(specs) for specs in groups.values()]


_LINK_BYTES = len(f"/{LINK_FOLDER}/01234567/01234567.sock")

EXIT_OK = 0
EXIT_FAILED = 1
EXIT_INVALID = 2
EXIT_NOT_INSTALLED = 3
EXIT_HARDWARE = 4
EXIT_INTERRUPTED = 130

#: Exit codes of failed starts in the order of their correction: first the file, then what is to be installed.
_CORRECTIONS = (EXIT_INVALID, EXIT_NOT_INSTALLED, EXIT_HARDWARE)

#: Time that the other nodes go on after a failure at the start, so that one run reports every missing device.
START_SETTLE_S = 0.5

#: Time for the guardians to read the order to drop, which is in the directory of the run, and to report.
GUARDIAN_TIMEOUT_S = 3.0

#: Exceptions in the supervisor itself after which it lets the fork server end the nodes.
MAX_DEFECTS = 10


class Phase(Enum):
    """Where a run stands."""

    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    ENDED = "ended"


class Supervisor:
    """Runs one plan. It owns processes, never devices.

    Args:
        plan: what to run.
        fork_server: started before any thread or transport existed. The caller closes it.
        options: settings.
        ui: receives every event.
    """

    def __init__(
        self,
        plan: Plan,
        fork_server: ForkServer,
        options: SupervisorOptions | None = None,
        ui: Subscriber | None = None,
    ) -> None:
        self._plan = plan
        self._fork_server = fork_server
        self._options = options or SupervisorOptions()
        self._ui = ui
        self._reactor = Reactor()
        self._processes: list[ManagedProcess] = []
        self._phase = Phase.STARTING
        self._reason = ""
        self._exit_code = EXIT_OK
        self._completed_s = 0.0
        self._interrupted = False
        self._began_s = 0.0
        self._ready_s: float | None = None
        self._first_message_s: float | None = None
        self._stop_began_s: float | None = None
        self._router: Any = None
        self._transport = plan.transport
        self._activated = False
        self._settling = False
        self._defects = 0
        self._repeated = RepeatedStop()
        self._awaited: set[str] = set()  # nodes whose guardians read the order to drop
        self._run = RunFacts()

    def run(self) -> RunReport:
        """Runs the plan to its end and returns the report. Call it once."""
        self._began_s = self._options.began_s or time.monotonic()
        log = new_log(self._options.log_directory, self._plan.robot_id)
        self._logbook = Logbook(self._reactor, log, self._ui)
        self._logbook.capture()
        self._requests = RunRequests(
            self._logbook,
            self._reactor,
            self._processes,
            status=self.status,
            stop=self.stop_soon,
            on_guardian=self._on_guardian,
        )
        signals = StopSignals(self._reactor, self._on_signal)
        with ExitStack() as stack:
            stack.callback(self._reactor.close)
            stack.callback(self._logbook.close)
            stack.callback(signals.close)
            if self._options.handle_signals:
                signals.install()
            if self._open_run_directory(stack):
                self._start(stack)
                while self._phase is not Phase.ENDED:
                    self._turn()
            report = self._report()
            self._event("stopped", "", report.reason)
            self._logbook.publish(report)
            return report

    def _turn(self) -> None:
        """Runs one turn of the loop. An exception in this program stops the nodes cleanly."""
        try:
            self._reactor.turn()
        except Exception as error:
            self._defects += 1
            if self._defects > MAX_DEFECTS:
                raise
            self._logbook.write(logging.ERROR, traceback.format_exc().rstrip())
            self._stop(f"the supervisor failed: {type(error).__name__}: {error}", EXIT_FAILED)

    # Start.

    def _open_run_directory(self, stack: ExitStack) -> bool:
        plan = self._plan
        nodes = [spec.full_name for spec in plan.nodes]
        try:
            source = os.path.abspath(plan.source)  # noqa: PTH100 (links stay as they are)
            directory = RunDirectory.create(
                self._options.run_base,
                source,
                plan.transport.domain_id,
                nodes,
                robot=plan.robot_id,
                actuators=[spec.full_name for spec in plan.nodes if spec.kind is NodeKind.ACTUATOR],
            )
            links = self._open_link_folder(stack, directory)
        except (NodesInUseError, RunDirectoryError) as error:
            self._exit_code = EXIT_HARDWARE if isinstance(error, NodesInUseError) else EXIT_FAILED
            self._reason = str(error)
            self._logbook.write(logging.ERROR, self._reason)
            return False
        self._place = RunPlace(self._reactor, self._logbook, directory, self._requests.handlers())
        stack.callback(self._place.close)
        self._run = directory.facts(self._logbook.path)
        self._run = replace(self._run, options=self._options.plan_options)
        if not self._options.devices_outlive_run:
            self._run = replace(self._run, energised_folder="")
        with suppress(OSError):  # giving the order then makes the file
            DropOrder(self._run.estop_files).prepare()
        self._transport = plan.transport.model_copy(update={"link_folder": str(links)})
        return True

    def _open_link_folder(self, stack: ExitStack, directory: RunDirectory) -> Path:
        """A folder for the sockets between the nodes, in the base of the run if their paths fit there."""
        base = self._options.run_base
        if len(os.fsencode(base)) + _LINK_BYTES > MAX_PATH_BYTES:
            base = short_base_directory(os.environ, _LINK_BYTES)
        try:
            return stack.enter_context(socket_folder(base, LINK_FOLDER))
        except RunDirectoryError:
            directory.close()
            raise

    def _start(self, stack: ExitStack) -> None:
        plan, options = self._plan, self._options
        launcher = Launcher(self._reactor, self._fork_server, self._on_fork_server_lost)
        self._terminal_guard = TerminalGuard(plan.nodes)
        stack.callback(launcher.close)
        stack.callback(self._terminal_guard.close)
        tools = (self._reactor, launcher, self._logbook)
        groups = process_groups(plan.nodes)
        self._processes += [
            ManagedProcess(specs, self._transport, options, tools, self._on_change, self._on_message)
            for specs in groups
        ]
        count = "1 node" if len(plan.nodes) == 1 else f"{len(plan.nodes)} nodes"
        self._logbook.write(logging.INFO, f"starting {count} of {plan.source}")
        if not self._processes:
            self._stop("the plan has no nodes for this machine", EXIT_FAILED)
            return
        # The processes start while this one opens the router. They join it when told to start.
        for process in self._processes:
            process.run = self._run
            process.spawn()
        ipc.prepare_supervisor()
        if not self._open_router(stack):
            return
        for process in self._processes:
            process.start()
        self._reactor.call_later(CHECK_PERIOD_S, self._check)
        self._reactor.call_later(options.status_period_s, self._show_status)
        limit_s = options.start_timeout_s or options.duration_s
        if limit_s is not None:
            self._reactor.call_later(limit_s, partial(self._end_start, limit_s))

    def _end_start(self, limit_s: float) -> None:
        """Fails the nodes that the others wait for."""
        for process in self._processes if self._phase is Phase.STARTING else ():
            if process.alive and not (process.ready if self._activated else process.configured):
                process.fail_start(limit_s)

    def _open_router(self, stack: ExitStack) -> bool:
        from joshua.plugins.targets import TargetError
        from joshua.transport import TransportError, prepare_transport

        try:
            self._router = prepare_transport(self._transport)
        except (TransportError, TargetError) as error:
            self._stop(str(error), error.exit_code)
            return False
        except Exception as error:  # noqa: BLE001 (whatever the middleware raises, the nodes must stop)
            self._stop(f"the transport cannot be opened: {type(error).__name__}: {error}", EXIT_FAILED)
            return False
        if self._router is not None:
            stack.callback(self._router.close)
        return True

    def _on_change(self, process: ManagedProcess, change: Change) -> None:
        actions = {
            Change.STARTED: self._started,
            Change.CONFIGURED: self._configured,
            Change.READY: self._ready,
            Change.ENDED: self._ended,
        }
        actions[change](process)

    def _on_message(self, message: ipc.NodeMessage) -> None:
        """Handles what concerns the run. The process has noted the message already."""
        if isinstance(message, ipc.CallReply):
            self._requests.replied(message)
        elif isinstance(message, ipc.Estopped):
            self._requests.estopped(message)
        elif isinstance(message, ipc.Progressed):
            self._logbook.publish(message.progress)
        elif isinstance(message, ipc.FirstMessage):
            if self._first_message_s is None:
                self._first_message_s = message.stamp_ns / 1e9 - self._began_s
        elif isinstance(message, ipc.Said):
            if message.kind == "shown":
                self._logbook.publish(self.status())
            elif message.kind == "fault":
                self._event("fault" if message.text else "resumed", message.node, message.text)
            elif message.kind == "stop-run":
                self._stop(f"{message.node}: {message.text}", EXIT_OK)

    def _configured(self, process: ManagedProcess) -> None:
        """Activates the nodes: all together at the start, a restarted one by itself."""
        if self._phase is Phase.RUNNING:
            process.activate()
        elif self._phase is Phase.STARTING and all(item.configured for item in self._processes):
            self._activated = True
            for item in self._processes:
                item.activate()
        self._settle()

    def _ready(self, process: ManagedProcess) -> None:
        """Shows the start-up table when the last process is ready."""
        self._tell(process, "ready")
        self._requests.ready(process)
        if self._phase is Phase.RUNNING:
            self._logbook.write(logging.INFO, f"{process.names}: ready again")
        elif self._phase is Phase.STARTING and all(item.ready for item in self._processes):
            self._phase = Phase.RUNNING
            self._ready_s = time.monotonic() - self._began_s
            self._show_table(self._ready_s)
            duration_s = self._options.duration_s or self._plan.duration_s
            if duration_s is not None:
                self._reactor.call_later(duration_s, partial(self._end_duration, duration_s))

    def _end_duration(self, duration_s: float) -> None:
        if self._phase is Phase.RUNNING:
            self._completed_s = duration_s
        self._stop(f"the duration of {duration_s:g} s is over", EXIT_OK)

    # Failures.

    def _ended(self, process: ManagedProcess) -> None:
        """Ends the run, restarts the process, or leaves it down, depending on phase and policy."""
        self._requests.ended(process)
        self._terminal_guard.ended(process.specs)
        self._tell(process)
        if self._phase is Phase.STOPPING:
            self._finish_if_stopped()
            return
        reasons = "; ".join(
            f"{name}: {record.reason.rstrip('.')}" for name, record in process.records.items()
        )
        if self._phase is Phase.STARTING:
            self._settle()
        elif process.policy.stops_run:
            self._stop(f"{reasons} (its restart policy stops the run)", EXIT_FAILED)
        else:
            self._restart_or_give_up(process)

    def _settle(self) -> None:
        """After a failure at the start: stops the run once every other process has ended or is configured."""
        if self._phase is not Phase.STARTING or not any(self._failed(item) for item in self._processes):
            return
        if self._activated or all(item.configured or not item.alive for item in self._processes):
            self._stop_failed_start()
        elif not self._settling:
            self._settling = True
            self._reactor.call_later(START_SETTLE_S, self._stop_failed_start)

    def _stop_failed_start(self) -> None:
        failed = [record for record in self._records() if record.state == "failed"]
        if self._phase is Phase.STARTING and failed:
            names: dict[str, list[str]] = {}
            for record in failed:
                names.setdefault(record.reason.rstrip("."), []).append(record.spec.full_name)
            reasons = "; ".join(f"{', '.join(group)}: {reason}" for reason, group in names.items())
            codes = [record.exit_code for record in failed]
            first = next((code for code in _CORRECTIONS if code in codes), codes[0])
            self._stop(f"the start failed: {reasons}", first)

    def _restart_or_give_up(self, process: ManagedProcess) -> None:
        decision = process.policy.failed(self._reactor.now_s())
        if isinstance(decision, float):
            text = f"starts again in {decision:g} s"
            process.restart_later(decision)
            self._tell(process, "restarting", text)
            self._logbook.write(logging.WARNING, f"{process.names}: {text}")
            return
        text = f"stays down: {decision}"
        self._tell(process, "given-up", text)
        self._logbook.write(logging.ERROR, f"{process.names}: {text}")
        if not any(item.alive or item.restart_timer for item in self._processes):
            self._stop("no node is left", EXIT_FAILED)

    def _failed(self, process: ManagedProcess) -> bool:
        return not process.alive and any(record.state == "failed" for record in process.records.values())

    def _on_fork_server_lost(self, reason: str) -> None:
        self._logbook.write(logging.ERROR, f"the fork server has died: {reason}")
        self._stop("the fork server has died, so no node could be restarted", EXIT_FAILED)

    def _check(self) -> None:
        for process in self._processes:
            process.check()
        if self._phase is not Phase.ENDED:
            self._reactor.call_later(CHECK_PERIOD_S, self._check)

    # Stop.

    def _on_signal(self, number: int) -> None:
        press = self._repeated.press(number, self._reactor.now_s())
        name = signal.Signals(number).name
        if press is Press.STOP:
            code = EXIT_OK if self._phase is Phase.RUNNING else EXIT_INTERRUPTED
            self._stop(f"stopped by {name}", code, interrupted=True)
            if self._phase is Phase.STOPPING:
                self._logbook.write(logging.INFO, self._notice().first(number))
        elif press is Press.AGAIN:
            self._logbook.write(logging.WARNING, self._notice().again(number))
        elif press is Press.FORCE:
            self._force_stop(name)

    def _notice(self) -> StopNotice:
        limit_s = max((process.stop_limit_s for process in self._processes), default=0.0)
        return StopNotice(self._plan.nodes, limit_s, energised=self._activated)

    def _force_stop(self, name: str) -> None:
        """Kills all nodes. Their guardians release what parks."""
        notice = self._notice()
        self._logbook.write(logging.WARNING, f"{name} repeated: this {notice.forced}")
        alive = [name for process in self._processes if process.alive for name in process.records]
        self._awaited = {name for name in notice.parking if name in alive}
        self._reactor.call_later(GUARDIAN_TIMEOUT_S, self._await_no_guardian)
        for process in self._processes:
            process.kill()
        try:
            DropOrder(self._run.estop_files).give()
        except OSError as error:
            self._logbook.write(logging.ERROR, f"the guardians go on parking: {error}")

    def _on_guardian(self, node: str) -> None:
        """Notes that a guardian has done its work."""
        if node in self._awaited:
            self._awaited.discard(node)
            self._reactor.call_later(0, self._finish_if_stopped)  # after the answer was sent

    def _await_no_guardian(self) -> None:
        self._awaited.clear()
        self._finish_if_stopped()

    def stop_soon(self, reason: str) -> None:
        """Stops the run on a user's request, after pending answers were sent."""
        self._reactor.call_later(0, lambda: self._stop(reason, EXIT_OK, interrupted=True))

    def _stop(self, reason: str, exit_code: int, *, interrupted: bool = False) -> None:
        if self._phase in (Phase.STOPPING, Phase.ENDED):
            return
        self._phase = Phase.STOPPING
        self._reason, self._exit_code, self._interrupted = reason, exit_code, interrupted
        self._stop_began_s = time.monotonic()
        in_order = exit_code in (EXIT_OK, EXIT_INTERRUPTED)
        known = [  # each has a separate line
            (record.spec.full_name, record.reason) for record in self._records()
        ]
        text = f"stopping: {without_reasons(reason, known)}"
        self._logbook.write(logging.INFO if in_order else logging.ERROR, text)
        self._event("stopping", "", reason)
        for process in self._processes:
            process.stop(reason)
        self._finish_if_stopped()

    def _finish_if_stopped(self) -> None:
        if not self._awaited and not any(process.alive for process in self._processes):
            self._phase = Phase.ENDED

    # Show.

    def _records(self) -> list[NodeRecord]:
        return [record for process in self._processes for record in process.records.values()]

    def _silent_topics(self) -> list[str]:
        """Describe the topics of the file on which a run of a given duration delivered nothing.

        A node that was restarted is left out: it had less time, and its failure is reported.
        """
        found = []
        for record in self._records():
            report = record.final_report()
            if report.restarts or report.state != "stopped":
                continue
            declared = {topic.name for topic in record.spec.publishers}
            found += [
                f"{topic.name} ({report.full_name}, {topic.configured_hz:g} Hz)"
                for topic in report.silent_topics(self._completed_s)
                if topic.name in declared
            ]
        return found

    def _report(self) -> RunReport:
        records = self._records()
        # The reason of a failure is kept until the node is active again.
        bad = any(record.fault or record.reason or record.state in ("failed", "killed") for record in records)
        if self._exit_code == EXIT_OK and bad:
            self._exit_code = EXIT_FAILED
        if silent := self._silent_topics():
            self._reason += f", but nothing was published on {', '.join(silent)}"
            self._exit_code = self._exit_code or EXIT_FAILED
            self._logbook.write(logging.ERROR, self._reason)
        stop_s = None if self._stop_began_s is None else time.monotonic() - self._stop_began_s
        return RunReport(
            exit_code=self._exit_code,
            reason=self._reason,
            interrupted=self._interrupted,
            judged=self._plan.verdict and self._ready_s is not None,
            nodes=tuple(record.final_report() for record in records),
            ready_s=self._ready_s,
            first_message_s=self._first_message_s,
            stop_s=stop_s,
            log=str(self._logbook.path),
        )

    def _show_table(self, ready_s: float) -> None:
        notes = [f"log: {self._logbook.path}", *priority_notes(self._records())]
        if self._router is not None:
            notes.append(str(self._router.description))
        table = start_table(self._plan, self._records(), ready_s, notes)
        self._logbook.publish(table)
        self._logbook.write(logging.DEBUG, f"all nodes ready after {ready_s:.2f} s")

    def status(self) -> RunStatus:
        """Current status of the run."""
        elapsed_s = time.monotonic() - self._began_s
        return run_status(self._plan, self._records(), self._phase.value, elapsed_s)

    def _show_status(self) -> None:
        if self._phase is not Phase.ENDED:
            self._place.look()
            self._logbook.publish(self.status())
            self._reactor.call_later(self._options.status_period_s, self._show_status)

    def _started(self, process: ManagedProcess) -> None:
        again = any(record.restarts for record in process.records.values())
        self._tell(
            process,
            "restarted" if again else "started",
            f"process {next(iter(process.records.values())).process_id}",
        )

    def _tell(self, process: ManagedProcess, kind: str = "", text: str = "") -> None:
        """Publishes an event of each node of a process, by default its state and reason."""
        for node, record in process.records.items():
            self._event(kind or record.state, node, text or record.reason)

    def _event(self, kind: str, node: str, text: str) -> None:
        self._logbook.publish(RunEvent(kind, node, text, time.time_ns()))
