"""What a run answers on its control socket."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any, Protocol

from joshua.ipc import messages as ipc
from joshua.plan import NodeKind
from joshua.supervisor.control_server import Deferred, Handler
from joshua.supervisor.logbook import Logbook
from joshua.supervisor.managed_process import ManagedProcess
from joshua.supervisor.status import RunStatus

Request = Mapping[str, Any]


class Run(Protocol):
    """The supervisor, as requests see it."""

    def status(self) -> RunStatus:
        """The run just now."""

    def stop_soon(self, reason: str) -> None:
        """Stops the run in good order, after the answer has left."""

    def process_of(self, node: str) -> ManagedProcess | None:
        """The process of a node."""

    def revive(self, process: ManagedProcess) -> None:
        """Starts a process again that stays down."""


class RunRequests:
    """The requests of one run.

    Args:
        run: the supervisor; logbook: of the run.
    """

    def __init__(self, run: Run, logbook: Logbook) -> None:
        self._run = run
        self._logbook = logbook
        self._resuming: dict[str, list[Deferred]] = {}

    def handlers(self) -> dict[str, Handler]:
        """By the name of the request."""
        return {
            "status": self._status,
            "stop": self._stop,
            "guardian": self._guardian,
            "estop": self._estop,
            "resume": self._resume,
        }

    def ready(self, process: ManagedProcess) -> None:
        """A process is ready: passes on what waited for that."""
        for node in process.records:
            asked = [deferred for deferred in self._resuming.pop(node, []) if not deferred.abandoned]
            if asked:  # who has broken the command off meanwhile wants no torque any more
                self._resuming[node] = asked
                process.resume(node)

    def ended(self, process: ManagedProcess) -> None:
        """A process has ended: nothing of it is resumed now."""
        for node, record in process.records.items():
            why = f"it failed: {record.reason}" if record.reason else "the run stops"
            self._answer(node, False, f"{node} is not resumed, because {why}")

    def resumed(self, message: ipc.Resumed) -> None:
        """A node has answered."""
        level = logging.WARNING if message.done else logging.ERROR
        self._logbook.write(level, f"resume: {message.text}", message.node)
        self._answer(message.node, message.done, message.text)

    def _answer(self, node: str, done: bool, text: str) -> None:
        for deferred in self._resuming.pop(node, []):
            deferred.answer({"resumed": done, "text": text})

    def _status(self, _request: Request) -> dict[str, Any]:
        return {"status": self._run.status().as_dict()}

    def _stop(self, _request: Request) -> dict[str, Any]:
        self._run.stop_soon("stopped by `joshua stop`")
        return {"stopping": True}

    def _guardian(self, request: Request) -> dict[str, Any]:
        """Takes the report of a guardian into the log."""
        level = request.get("level")
        level = level if isinstance(level, int) else logging.ERROR
        self._logbook.write(level, str(request.get("text", "")), str(request.get("node", "")))
        return {"written": True}

    def _estop(self, request: Request) -> dict[str, Any]:
        """Notes an e-stop; drivers and guardians look for the latch themselves."""
        text = "the e-stop is released" if request.get("released") else "the e-stop is latched"
        self._logbook.write(logging.CRITICAL, f"{text} by process {request.get('process_id')}")
        return {"noted": True}

    def _resume(self, request: Request) -> dict[str, Any] | Deferred:
        node = str(request.get("node", ""))
        process = self._run.process_of(node)
        if process is None:
            return {"error": f"this run has no node {node}"}
        if process.records[node].spec.kind is not NodeKind.ACTUATOR:
            return {"error": f"{node} is no actuator: there is nothing to resume"}
        phase = self._run.status().phase
        if phase == "stopping" or (phase == "starting" and not process.alive):
            return {"error": f"the run is {phase} and {node} has no part in it any more: start the run again"}
        deferred = Deferred()
        waits = node in self._resuming
        self._resuming.setdefault(node, []).append(deferred)
        if waits:
            return deferred
        if process.ready:
            process.resume(node)
        elif not process.alive and process.restart_timer is None:
            self._run.revive(process)
        return deferred
