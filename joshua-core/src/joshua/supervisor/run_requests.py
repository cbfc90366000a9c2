"""The requests on the control socket of a run."""

from __future__ import annotations

import itertools
import json
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from joshua.guardian.latch import latch_of
from joshua.ipc import messages as ipc
from joshua.ipc.client import is_named
from joshua.ipc.frames import FrameError
from joshua.plan.events import EVENT_NAMES, RunStatus, event_record
from joshua.supervisor.control_server import Connection, Handler, Request
from joshua.supervisor.logbook import MAX_STREAMS, Logbook
from joshua.supervisor.managed_process import ManagedProcess
from joshua.supervisor.reactor import Reactor, ReactorTimer

#: Default and maximum of a call's timeout.
CALL_TIMEOUT_S = 10.0
CALL_TIMEOUT_MAX_S = 3600.0


@dataclass
class _Pending:
    """A call without an answer yet; ``sent`` to its node, or waiting until that is ready."""

    message: ipc.Call
    process: ManagedProcess
    client: Connection
    timeout_s: float
    timer: ReactorTimer
    sent: bool = False


class RunRequests:
    """The requests of one run.

    Args:
        logbook: of the run; reactor: its loop; processes: of its nodes, filled when they start.
        status: current status of the run.
        stop: stops the run cleanly for the given reason, after the answer was sent.
        on_guardian: called with the node of each guardian that reports its work.
    """

    def __init__(
        self,
        logbook: Logbook,
        reactor: Reactor,
        processes: Sequence[ManagedProcess],
        status: Callable[[], RunStatus],
        stop: Callable[[str], None],
        on_guardian: Callable[[str], None] = lambda _node: None,
    ) -> None:
        self._logbook = logbook
        self._reactor = reactor
        self._processes = processes
        self._run_status = status
        self._stop_run = stop
        self._on_guardian = on_guardian
        self._ids = itertools.count(1)
        self._pending: dict[int, _Pending] = {}
        self._held_estop: ipc.Estop | None = None
        self._estop_clients: list[Connection] = []

    def handlers(self) -> dict[str, Handler]:
        """By the name of the request."""
        return {
            "status": lambda _request, _client: {"status": self._run_status().as_dict()},
            "stop": self._stop,
            "guardian": self._guardian,
            "estop": self._estop,
            "call": self._call,
            "subscribe": self._subscribe,
        }

    def ready(self, process: ManagedProcess) -> None:
        """Sends the calls that waited for a process, and an e-stop that is not a file."""
        if self._held_estop is not None:
            process.send(self._held_estop)
        for pending in list(self._pending.values()):
            if pending.process is process and not pending.sent:
                if pending.client.closed:  # the command was interrupted
                    self._forget(pending.message.id)
                else:
                    self._send(pending)

    def ended(self, process: ManagedProcess) -> None:
        """Fails the calls to a process that ended."""
        for pending in list(self._pending.values()):
            if pending.process is process:
                message = pending.message
                reason = process.records[message.node].reason
                why = f"it failed: {reason}" if reason else "it was stopped"
                self._fail(pending, "gone", f"{message.node} ended before it answered {message.verb}: {why}")

    def replied(self, reply: ipc.CallReply) -> None:
        """Passes on the answer of a node. An answer after the timeout is dropped."""
        pending = self._forget(reply.id)
        if pending is None:
            self._logbook.write(logging.DEBUG, f"late answer to call {reply.id}: {reply.text}", reply.node)
            return
        verb = pending.message.verb
        if verb != ipc.LIST_VERBS:
            text = str(reply.payload.get("text", "done")) if reply.ok else reply.text
            level = logging.INFO if "text" in reply.payload or not reply.ok else logging.DEBUG
            if reply.moves:
                level = logging.WARNING if reply.ok else logging.ERROR
            self._logbook.write(level, f"{verb}: {text}", reply.node)
        pending.client.send(
            {"reply": reply.payload, "node": reply.node}
            if reply.ok
            else _error(reply.code, reply.text, reply.allowed)
        )

    def _stop(self, _request: Request, _client: Connection) -> dict[str, Any]:
        self._stop_run("stopped by `joshua stop`")
        return {"stopping": True}

    def _guardian(self, request: Request, _client: Connection) -> dict[str, Any]:
        """Logs the report of a guardian, or notes why it kills a driver (``kills``)."""
        if "kills" in request:
            for process in self._processes:
                process.killed_by_guardian(str(request.get("node", "")), str(request["kills"]))
            return {"written": True}
        level = request.get("level")
        level = level if isinstance(level, int) else logging.ERROR
        node = str(request.get("node", ""))
        self._logbook.write(level, str(request.get("text", "")), node)
        self._on_guardian(node)
        return {"written": True}

    def _estop(self, request: Request, client: Connection) -> dict[str, Any]:
        """Passes an e-stop, or its release, on to the nodes, and their reports to the client.

        Drivers and guardians read the latch themselves. They act earlier if they are told, and they must be
        told if the latch could not be stored.
        """
        if request.get("released") is True:
            return self._release_estop(request)
        latch, stored = request.get("latch"), request.get("stored") is not False
        try:
            if latch is not None:
                latch_of(latch)
        except (TypeError, KeyError) as error:
            return _error("invalid", f"latch is {latch!r}, which is no e-stop: {error}")
        message = ipc.Estop(latch=latch, stored=stored)
        self._held_estop = None if latch is None or stored else message
        self._tell_all(message)
        self._logbook.write(logging.CRITICAL, f"the e-stop is latched by process {request.get('process_id')}")
        self._estop_clients = [item for item in self._estop_clients if not item.closed]
        self._estop_clients.append(client)
        return {"noted": True}

    def _release_estop(self, request: Request) -> dict[str, Any]:
        """Ends an e-stop; with ``held_only`` only one that is no file."""
        held, self._held_estop = self._held_estop, None
        if held is not None or not request.get("held_only"):
            self._tell_all(ipc.Estop())
            text = f"the e-stop is released by process {request.get('process_id')}"
            self._logbook.write(logging.CRITICAL, text)
        return {"noted": True, "held": held is not None}

    def _tell_all(self, message: ipc.Estop) -> None:
        for process in self._processes:
            if process.alive:
                process.send(message)

    def estopped(self, message: ipc.Estopped) -> None:
        """Passes the report of a node to the commands that wait for it."""
        for client in self._estop_clients:
            client.send({"report": message.report})

    def _subscribe(self, request: Request, client: Connection) -> dict[str, Any] | None:
        """Sends the status and then events; ``events`` names the wanted ones."""
        names = request.get("events", [])
        if not isinstance(names, list) or not all(name in EVENT_NAMES for name in names):
            return _error("invalid", f"events is {names!r}; allowed is a list of names", EVENT_NAMES)
        if not self._logbook.subscribe(client, names):
            return _error("refused", f"{MAX_STREAMS} programs watch this run already: end one of them")
        if not names or "status" in names:
            client.offer(json.dumps(event_record(self._run_status())).encode() + b"\n")
        return None

    def _call(self, request: Request, client: Connection) -> dict[str, Any] | None:
        """Calls a verb of a node; ``start`` starts one that is down and waits for one that starts."""
        word, verb, payload = request.get("node"), request.get("verb"), request.get("payload", {})
        timeout_s, start = request.get("timeout_s", CALL_TIMEOUT_S), request.get("start") is True
        if not (isinstance(word, str) and isinstance(verb, str) and isinstance(payload, dict)):
            return _error("invalid", "a call needs the names of node and verb, and an object as payload")
        if not isinstance(timeout_s, (int, float)) or not 0 < timeout_s <= CALL_TIMEOUT_MAX_S:
            text = f"timeout_s is {timeout_s!r}; allowed is a number above 0 and up to {CALL_TIMEOUT_MAX_S:g}"
            return _error("invalid", text)
        status = self._run_status()
        names = [item.full_name for item in status.nodes]
        named = [name for name in names if is_named(name, word)]
        process = next((item for item in self._processes if named and named[0] in item.records), None)
        if process is None or len(named) > 1:
            return _unknown_node(word, names, named)
        node, record = named[0], process.records[named[0]]
        waits = process.alive or process.restart_timer is not None
        if status.phase == "stopping" or (status.phase == "starting" and not process.alive):
            text = f"the run is {status.phase} and {node} is not running: start the run again"
            return _error("not-running", text)
        serves = record.state in ("ready", "resuming") and process.alive
        if not serves and not start:
            what = f"is {record.state}: try again" if waits else f"stays down: {record.reason}"
            return _error("not-running", f"{node} {what}")
        deadline_ns = time.monotonic_ns() + round(timeout_s * 1e9)
        message = ipc.Call(id=next(self._ids), node=node, verb=verb, payload=payload, deadline_ns=deadline_ns)
        try:
            ipc.decode_for_child(ipc.encode(message))  # a message that the node cannot read would end it
        except FrameError as error:
            return _error("invalid", f"the call cannot be passed on: {error}")
        timer = self._reactor.call_later(timeout_s, lambda: self._too_late(message.id))
        self._pending[message.id] = pending = _Pending(message, process, client, timeout_s, timer)
        if serves:
            self._send(pending)
        elif not waits:
            process.revive()
        return None

    def _send(self, pending: _Pending) -> None:
        pending.sent = True
        pending.process.send(pending.message)

    def _too_late(self, identifier: int) -> None:
        pending = self._pending[identifier]
        node, verb = pending.message.node, pending.message.verb
        doing = pending.process.records[node].doing
        text = f"{node} has not answered {verb} within {pending.timeout_s:g} s: it is {doing}"
        self._fail(pending, "timeout", f"{text}; a later answer is dropped")

    def _fail(self, pending: _Pending, code: str, text: str) -> None:
        self._forget(pending.message.id)
        self._logbook.write(logging.ERROR, f"{pending.message.verb}: {text}", pending.message.node)
        pending.client.send(_error(code, text))

    def _forget(self, identifier: int) -> _Pending | None:
        pending = self._pending.pop(identifier, None)
        if pending is not None:
            pending.timer.cancel()
        return pending


def _unknown_node(word: str, known: list[str], found: list[str]) -> dict[str, Any]:
    if found:
        return _error("unknown-node", f"several nodes are called {word!r}", found)
    near = get_close_matches(word.lstrip("/"), [name.lstrip("/") for name in known], n=3, cutoff=0.5)
    names = dict.fromkeys([*(f"/{name}" for name in near), *known])
    return _error("unknown-node", f"this run has no node {word!r}", list(names))


def _error(code: str, text: str, allowed: Sequence[str] = ()) -> dict[str, Any]:
    answer: dict[str, Any] = {"error": text, "code": code}
    return {**answer, "allowed": list(allowed)} if allowed else answer
