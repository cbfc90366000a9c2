"""One process of the plan, over all its restarts: messages in, state out.

Why one file: every step of a process's life reads and sets the same state.
"""

from __future__ import annotations

import logging
import os
import re
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from enum import Enum

from joshua.guardian.silence import ThreadTime, thread_time
from joshua.ipc import messages as ipc
from joshua.plan import ActuatorFacts, NodeFacts, NodeSpec, RunFacts, TransportSettings, installing
from joshua.plan.events import LogEntry
from joshua.plan.foreign_text import printable
from joshua.supervisor.child import Child, ChildEvent, Output
from joshua.supervisor.fork_server import ForkServerEvent
from joshua.supervisor.heartbeats import HeartbeatWatch
from joshua.supervisor.launcher import Launcher, describe_status
from joshua.supervisor.logbook import Logbook
from joshua.supervisor.node_record import NodeRecord
from joshua.supervisor.policies import (
    HANG_TIMES,
    RestartPolicy,
    Rung,
    StopLadder,
    SupervisorOptions,
    ladder_times,
    ready_timeout_s,
)
from joshua.supervisor.reactor import Reactor, ReactorTimer


class Change(Enum):
    """A step in the life of a process; CONFIGURED and READY count for all its nodes together."""

    STARTED = "started"
    CONFIGURED = "configured"
    READY = "ready"
    ENDED = "ended"


_FRAME = re.compile(r'^  File "(?P<file>.*)", line (?P<line>\d+) in (?P<function>.*)$')


class StackDump:
    """Finds the stacks of ``faulthandler`` in standard error."""

    def __init__(self) -> None:
        self.place = ""
        self._current = False

    def take(self, line: str) -> bool:
        """Takes a line and returns whether it belongs to the stacks.

        ``place`` becomes the innermost frame of the thread that got the signal, usually the main thread.
        """
        frame = _FRAME.match(line)
        if frame is not None:
            if self._current and not self.place:
                self.place = f"{frame['function']} ({frame['file']}:{frame['line']})"
            return True
        self._current = line.startswith("Current thread 0x")
        return self._current or line.startswith("Thread 0x") or not line


#: Time for a hung process to write the stacks of its threads.
DUMP_TIMEOUT_S = 0.3

#: Begin of the reason of a process that was killed.
KILLED = "its process was killed by SIGKILL"

EXIT_NODE_FAILED = 1
EXIT_NOT_INSTALLED = 3


class ManagedProcess:
    """Starts, watches and stops the process of one or several nodes.

    Args:
        specs: its nodes.
        transport: how they talk.
        options: of the supervisor.
        tools: reactor, launcher and logbook of the run.
        on_change: called with each step of its life.
        on_message: called with each message of its nodes.
    """

    def __init__(
        self,
        specs: tuple[NodeSpec, ...],
        transport: TransportSettings,
        options: SupervisorOptions,
        tools: tuple[Reactor, Launcher, Logbook],
        on_change: Callable[[ManagedProcess, Change], None],
        on_message: Callable[[ipc.NodeMessage], None],
    ) -> None:
        self.specs = specs
        self.records = {spec.full_name: NodeRecord(spec) for spec in specs}
        self.policy = RestartPolicy([spec.restart for spec in specs], options.restart)
        self.watch = HeartbeatWatch(self._loop_time)
        self.restart_timer: ReactorTimer | None = None
        self.stop_reason = ""
        self.run = RunFacts()
        self._transport = transport
        self._options = options
        self._reactor, self._launcher, self._logbook = tools
        self._on_change = on_change
        self._on_message = on_message
        self._child: Child | None = None
        self._ladder = self._new_ladder()
        self._deadline: ReactorTimer | None = None
        self._restarted = False
        self._urgent = False
        self._kill_reason = "it did not stop in time"
        self._dump: StackDump | None = None

    @property
    def names(self) -> str:
        """The nodes, for messages."""
        return ", ".join(self.records)

    @property
    def alive(self) -> bool:
        """Whether the process exists or is starting."""
        return self._child is not None and not self._child.ended

    @property
    def configured(self) -> bool:
        """Whether every node is configured, or further."""
        return all(record.state in ("configured", "ready") for record in self.records.values())

    @property
    def ready(self) -> bool:
        """Whether every node is active."""
        return all(record.state == "ready" for record in self.records.values())

    @property
    def stop_limit_s(self) -> float:
        """Time from the stop request until the process is killed."""
        times = ladder_times(self.specs, self._options.ladder)
        return times.request_s + times.terminate_s

    def spawn(self) -> None:
        """Starts the process. ``start`` sends it the nodes to run."""
        self.restart_timer = None
        self._urgent, self._dump = False, None
        for record in self.records.values():
            record.begin()
        self._ladder = self._new_ladder()
        title = self.specs[0].process_group or self.specs[0].name
        interpreter = self.specs[0].interpreter
        if interpreter and not os.access(interpreter, os.X_OK):
            text = f"its interpreter {interpreter} is missing or cannot be run. Correct Node.python"
            self._fail_all(text, EXIT_NOT_INSTALLED)
            self._reactor.call_later(0, lambda: self._on_change(self, Change.ENDED))
            return
        light = {name for spec in self.specs for name in (*spec.extensions, spec.settings_type) if name}
        light |= {spec.facts.estop_action for spec in self.specs if isinstance(spec.facts, ActuatorFacts)}
        modules = tuple(sorted(name.partition(":")[0] for name in light if name))
        self._child = Child(self._reactor, self._launcher, title, modules, interpreter, self._on_child)

    def start(self) -> None:
        """Sends the nodes to run."""
        specs = tuple(spec.model_copy(update={"facts": self._facts(spec)}) for spec in self.specs)
        message = ipc.Start(
            nodes=specs,
            transport=self._transport,
            log_level=self._options.log_level,
            heartbeat_s=self._options.heartbeat_s,
        )
        self.send(message)
        self._set_deadline()

    def _facts(self, spec: NodeSpec) -> NodeFacts:
        """Facts of the plan and of the run."""
        facts = replace(spec.facts, restarted=self._restarted)
        return replace(facts, run=self.run) if isinstance(facts, ActuatorFacts) else facts

    def activate(self) -> None:
        """Activates the nodes."""
        self.send(ipc.Activate())
        self._set_deadline()

    def send(self, message: ipc.Message) -> None:
        """Sends a message, such as a ``Call``."""
        if self._child is not None:
            self._child.send(message)

    def stop(self, reason: str) -> None:
        """Begins the stop ladder. A process that waits for its restart stays down."""
        self.stop_reason = self.stop_reason or reason
        if self.restart_timer is not None:
            self.restart_timer.cancel()
            self.restart_timer = None
            for record in self.records.values():
                record.state = "failed"
        if self.alive:
            self._cancel_deadline()
            self._ladder.begin()

    def kill(self) -> None:
        """Kills the process at once, on a user's request."""
        if self.alive:
            self._kill_reason = "killed by a repeated signal"
            self._ladder.kill()

    def restart_later(self, delay_s: float) -> None:
        """Starts the process again after a delay."""
        self._restarted = True
        for record in self.records.values():
            record.state = "restarting"
            record.restarts += 1
        self.restart_timer = self._reactor.call_later(delay_s, self._restart)

    def killed_by_guardian(self, node: str, why: str) -> None:
        """Notes why a guardian kills the process of a node; its end may have been reported already."""
        if record := self.records.get(node):
            record.kill_reason = f"its guardian killed it: {printable(why)}"
            if not self.alive and record.reason.startswith(KILLED):
                record.reason = record.kill_reason

    def revive(self) -> None:
        """Starts a process that stays down, because a person has checked its device."""
        self.policy.forget()
        self.restart_later(0.0)

    def check(self) -> None:
        """Ends the process if one of its nodes hangs. Call every ``CHECK_PERIOD_S``."""
        if self._child is not None:
            self._child.report_dropped()
        if not self.watch.active or self._ladder.begun or self._dump is not None or self._child is None:
            return
        hang = self.watch.hung()
        if hang is None:
            return
        node, evidence = hang
        self._logbook.write(logging.ERROR, f"it hangs: {evidence}", node)
        self._dump = StackDump()
        self._child.signal(signal.SIGUSR2)  # answered with the stacks of its threads
        self.records[node].fail(f"it hung: {evidence}", EXIT_NODE_FAILED)
        self._urgent = True
        self._reactor.call_later(DUMP_TIMEOUT_S, self._end_hang)

    # Events of the child.

    def _on_child(self, event: ChildEvent) -> None:
        if isinstance(event, Output):
            self._on_output(event.stream, event.text)
        elif isinstance(event, ipc.Hello):
            self._on_hello(event)
        elif not isinstance(event, ForkServerEvent):
            self._on_node_message(event)
        elif event.event == "started":
            for record in self.records.values():
                record.process_id = event.process_id
            self._on_change(self, Change.STARTED)
        else:
            self._on_end(event.status, event.text)

    def _on_node_message(self, message: ipc.NodeMessage) -> None:
        name = message.report.full_name if isinstance(message, ipc.Report) else message.node
        record = self.records.get(name)
        if record is None:
            self._logbook.write(logging.WARNING, f"{self.names}: message of an unknown node {name!r}")
            return
        if isinstance(message, ipc.Heartbeat):
            self.watch.hear(message)
        elif isinstance(message, ipc.Log):
            self._on_log(message)
        elif isinstance(message, ipc.Topics):
            record.count(message)
        elif isinstance(message, ipc.Step):
            self._on_step(record, message.step)
        elif isinstance(message, ipc.Said):
            if message.kind == "warning":
                self._logbook.write(logging.WARNING, message.text, name)
            record.say(message.kind, message.text)
        elif isinstance(message, ipc.Progressed):
            record.progress[message.progress.name] = message.progress
        elif isinstance(message, ipc.Failure):
            self._on_failure(record, message)
        elif isinstance(message, ipc.Report):
            record.report = message.report
        self._on_message(message)

    def _on_output(self, stream: str, line: str) -> None:
        node = self.specs[0].full_name
        if stream == "dropped":
            self._logbook.write(logging.WARNING, line, node)
            return
        level = logging.INFO if stream == "stdout" else logging.WARNING
        if self._dump is not None and stream == "stderr":
            known = bool(self._dump.place)
            if self._dump.take(line):
                level = logging.DEBUG
            if self._dump.place and not known:
                self._logbook.write(logging.ERROR, f"it hangs in {self._dump.place}", self.names)
                self._end_hang()
        self._logbook.add(LogEntry(time.time_ns(), node, level, line, stream=stream))

    def _on_end(self, status: int | None, refusal: str) -> None:
        self._cancel_deadline()
        self._ladder.ended()
        self.watch.end()
        asked = bool(self.stop_reason)
        killed = self._ladder.rung is Rung.KILL
        for record in self.records.values():
            record.step = ""
            if record.state == "failed":
                if self._dump is not None and self._dump.place and record.reason.startswith("it hung"):
                    record.reason += f", in {self._dump.place}"
                continue
            if asked and killed:
                record.state, record.reason = "killed", self._kill_reason
            elif asked and record.report is not None:
                record.state = "stopped"
            elif asked and record.state in ("starting", "stopping") and status == 0:
                record.state = "stopped"  # asked before it had started
            else:
                reason, exit_code = self._why(status)
                record.fail(
                    refusal or record.kill_reason or reason, EXIT_NODE_FAILED if refusal else exit_code
                )
                self._logbook.write(logging.ERROR, record.reason, record.spec.full_name)
        self._on_change(self, Change.ENDED)

    # Parts.

    def _on_hello(self, message: ipc.Hello) -> None:
        if message.protocol != ipc.PROTOCOL_VERSION:
            text = (
                f"its environment has joshua-core {message.version}, which uses another protocol "
                f"({message.protocol}, expected {ipc.PROTOCOL_VERSION}): install the same version there"
            )
            self._fail_all(text, EXIT_NOT_INSTALLED)
            self._ladder.kill()

    def _on_step(self, record: NodeRecord, step: str) -> None:
        record.step = step
        name = record.spec.full_name
        self._logbook.write(logging.DEBUG, f"step: {step}", name)
        if step == "configured":
            record.state = "configured"
            if self.configured:
                self._cancel_deadline()
                self._on_change(self, Change.CONFIGURED)
        elif step == "active":
            resumed, record.state, record.reason = record.state == "resuming", "ready", ""
            self.watch.begin(record.spec)
            if self.ready:
                self._cancel_deadline()
                if not resumed:
                    self._on_change(self, Change.READY)
        elif step == "activate" and record.state == "ready":  # it resumes
            record.state = "resuming"
            self.watch.drop(name)
            self._set_deadline()
        elif step == "deactivate":
            self.watch.end()
            if record.state != "failed":
                record.state = "stopping"
            if not self._ladder.begun:
                # It stops by itself after a failure, within the ladder's times.
                self._ladder.begin()

    def _end_hang(self) -> None:
        """Stops a hung process after its stack dump or the timeout of that."""
        if self._dump is not None and self.alive:
            self._ladder.begin(HANG_TIMES)

    def _on_log(self, log: ipc.Log) -> None:
        entry = LogEntry(log.time_ns, log.node, log.level, log.text, log.logger, "log", log.file, log.line)
        self._logbook.add(entry)

    def _on_failure(self, record: NodeRecord, failure: ipc.Failure) -> None:
        record.fail(failure.text, failure.exit_code)
        if failure.is_permanent:
            self.policy.give_up("a restart would fail in the same way")
        name = record.spec.full_name
        # A hang is known already. What follows is its end.
        level = logging.ERROR if self._dump is None else logging.DEBUG
        self._logbook.write(level, f"failed in step {failure.step}: {failure.text}", name)
        if failure.traceback:
            level = logging.ERROR if failure.unexpected else logging.DEBUG
            self._logbook.write(level, failure.traceback.rstrip(), name)

    def _loop_time(self, thread_id: int) -> ThreadTime | None:
        process_id = 0 if self._child is None else self._child.process_id
        return thread_time(process_id, thread_id or process_id)

    def _restart(self) -> None:
        self._logbook.write(logging.WARNING, f"{self.names}: starting again")
        self.spawn()
        self.start()

    def _new_ladder(self) -> StopLadder:
        return StopLadder(self._reactor, ladder_times(self.specs, self._options.ladder), self._climb)

    def _climb(self, rung: Rung, elapsed_s: float) -> None:
        if self._child is None:
            return
        if rung is Rung.REQUEST:
            reason = self.stop_reason or "a node of this process failed"
            self._child.send(ipc.Stop(reason=reason, urgent=self._urgent))
            return
        number = signal.SIGTERM if rung is Rung.TERMINATE else signal.SIGKILL
        doing = "; ".join(f"{name} is {record.doing}" for name, record in self.records.items())
        self._logbook.write(
            logging.WARNING, f"{rung.value} after {elapsed_s:.1f} s: {doing}", self.specs[0].full_name
        )
        self._child.signal(number)

    def _set_deadline(self) -> None:
        self._cancel_deadline()
        limits_s = [ready_timeout_s(spec) for spec in self.specs]
        limit_s = max(*limits_s, self._options.start_timeout_s or 0.0)
        self._deadline = self._reactor.call_later(limit_s, lambda: self.fail_start(limit_s))

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()

    def fail_start(self, limit_s: float) -> None:
        """Fails the nodes that are not ready, and stops the process."""
        for name, record in self.records.items():
            if record.state in ("starting", "configured", "resuming"):
                text = (
                    f"not ready after {limit_s:g} s: it is still {record.doing}. "
                    "Allow a longer start with --start-timeout SECONDS"
                )
                self._logbook.write(logging.ERROR, text, name)
                record.fail(text, EXIT_NODE_FAILED)
        self._urgent = True
        self._ladder.begin(HANG_TIMES)

    def _fail_all(self, text: str, exit_code: int) -> None:
        for name, record in self.records.items():
            record.fail(text, exit_code)
            self._logbook.write(logging.ERROR, text, name)

    def _why(self, status: int | None) -> tuple[str, int]:
        """Reason and exit code of an unexpected end."""
        text = f"its process {describe_status(status)}"
        if text == KILLED:
            text += ", by a person or because the memory was full: `dmesg` tells which"
        errors = list(self._child.last_errors) if self._child is not None else []
        interpreter = self.specs[0].interpreter
        if interpreter and any("No module named" in line for line in errors):
            remedy = f"{interpreter} -m pip install {installing.target(installing.CORE)}"
            return f"{text}: {errors[-1]}; install what is missing: {remedy}", EXIT_NOT_INSTALLED
        return f"{text}; it last wrote: {errors[-1]}" if errors else text, EXIT_NODE_FAILED
