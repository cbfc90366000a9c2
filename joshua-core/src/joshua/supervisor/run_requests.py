"""What a run answers on its control socket."""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Protocol

from joshua.ipc import messages as ipc
from joshua.ipc.client import is_named
from joshua.ipc.frames import FrameError
from joshua.plan.events import EVENT_NAMES, RunStatus
from joshua.supervisor.control_server import Deferred, Handler
from joshua.supervisor.event_bus import MAX_STREAMS, EventStream
from joshua.supervisor.logbook import Logbook
from joshua.supervisor.managed_process import ManagedProcess
from joshua.supervisor.reactor import Reactor, ReactorTimer

Request = Mapping[str, Any]

#: How long a call may take unless it says so itself, and at most.
CALL_TIMEOUT_S = 10.0
CALL_TIMEOUT_MAX_S = 3600.0


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


@dataclass
class _Pending:
    """A call that is not answered yet; ``sent`` to its node, or it waits until that is ready."""

    message: ipc.Call
    deferred: Deferred
    timeout_s: float
    timer: ReactorTimer
    sent: bool = False


class RunRequests:
    """The requests of one run.

    Args:
        run: the supervisor; logbook: of the run; reactor: its loop.
    """

    def __init__(self, run: Run, logbook: Logbook, reactor: Reactor) -> None:
        self._run = run
        self._logbook = logbook
        self._reactor = reactor
        self._ids = itertools.count(1)
        self._pending: dict[int, _Pending] = {}

    def handlers(self) -> dict[str, Handler]:
        """By the name of the request."""
        return {
            "status": self._status,
            "stop": self._stop,
            "guardian": self._guardian,
            "estop": self._estop,
            "call": self._call,
            "subscribe": self._subscribe,
        }

    def ready(self, process: ManagedProcess) -> None:
        """A process is ready: passes on the calls that waited for that."""
        for pending in list(self._pending.values()):
            if pending.message.node in process.records and not pending.sent:
                if pending.deferred.abandoned:  # who has broken the command off wants nothing any more
                    self._forget(pending.message.id)
                else:
                    self._send(pending, process)

    def ended(self, process: ManagedProcess) -> None:
        """A process has ended: nothing of it answers a call now."""
        for pending in list(self._pending.values()):
            record = process.records.get(pending.message.node)
            if record is not None:
                why = f"it failed: {record.reason}" if record.reason else "it was stopped"
                text = f"{pending.message.node} ended before it answered {pending.message.verb}: {why}"
                self._fail(pending, "gone", text)

    def replied(self, reply: ipc.CallReply) -> None:
        """A node has answered; an answer that nobody waits for any more is dropped."""
        pending = self._forget(reply.id)
        if pending is None:
            self._logbook.write(logging.DEBUG, f"late answer to call {reply.id}: {reply.text}", reply.node)
            return
        verb = pending.message.verb
        if verb != ipc.LIST_VERBS:
            text = str(reply.payload.get("text", "done")) if reply.ok else reply.text
            severe = logging.WARNING if reply.ok else logging.ERROR
            level = severe if reply.moves else logging.INFO
            self._logbook.write(level, f"{verb}: {text}", reply.node)
        pending.deferred.answer(
            {"reply": reply.payload, "node": reply.node}
            if reply.ok
            else _error(reply.code, reply.text, reply.allowed)
        )

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

    def _subscribe(self, request: Request) -> dict[str, Any] | EventStream:
        """Sends events from now on, the status at once; ``events`` names those that are wanted."""
        names = request.get("events", [])
        if not isinstance(names, list) or not all(name in EVENT_NAMES for name in names):
            return _error("invalid", f"events is {names!r}; allowed is a list of names", EVENT_NAMES)
        stream = EventStream(names, (self._run.status(),))
        if not self._logbook.events.subscribe(stream):
            return _error("refused", f"{MAX_STREAMS} programs watch this run already: end one of them")
        return stream

    def _call(self, request: Request) -> dict[str, Any] | Deferred:
        """Asks a node; ``start`` starts one that stays down, and waits for one that starts."""
        word, verb, payload = request.get("node"), request.get("verb"), request.get("payload", {})
        timeout_s, start = request.get("timeout_s", CALL_TIMEOUT_S), request.get("start") is True
        if not (isinstance(word, str) and isinstance(verb, str) and isinstance(payload, dict)):
            return _error("invalid", "a call needs the names of node and verb, and an object as payload")
        if not isinstance(timeout_s, (int, float)) or not 0 < timeout_s <= CALL_TIMEOUT_MAX_S:
            text = f"timeout_s is {timeout_s!r}; allowed is a number above 0 and up to {CALL_TIMEOUT_MAX_S:g}"
            return _error("invalid", text)
        status = self._run.status()
        named = [item.full_name for item in status.nodes if is_named(item.full_name, word)]
        process = self._run.process_of(named[0]) if len(named) == 1 else None
        if process is None:
            return _unknown_node(word, [item.full_name for item in status.nodes], several=len(named) > 1)
        node, record = named[0], process.records[named[0]]
        waits = process.alive or process.restart_timer is not None
        if status.phase == "stopping" or (status.phase == "starting" and not process.alive):
            text = f"the run is {status.phase} and {node} has no part in it any more: start the run again"
            return _error("not-running", text)
        serves = record.state in ("ready", "resuming") and process.alive
        if not serves and not start:
            what = f"is {record.state}: try again" if waits else f"stays down: {record.reason}"
            return _error("not-running", f"{node} {what}")
        deadline_ns = time.monotonic_ns() + round(timeout_s * 1e9)
        message = ipc.Call(id=next(self._ids), node=node, verb=verb, payload=payload, deadline_ns=deadline_ns)
        try:
            ipc.decode_for_child(ipc.encode(message))  # what its node could not read would end that node
        except FrameError as error:
            return _error("invalid", f"the call cannot be passed on: {error}")
        timer = self._reactor.call_later(timeout_s, lambda: self._too_late(message.id))
        pending = _Pending(message, Deferred(), timeout_s, timer)
        self._pending[message.id] = pending
        if serves:
            self._send(pending, process)
        elif not waits:
            self._run.revive(process)
        return pending.deferred

    def _send(self, pending: _Pending, process: ManagedProcess) -> None:
        pending.sent = True
        process.call(pending.message)

    def _too_late(self, identifier: int) -> None:
        pending = self._pending[identifier]
        node = pending.message.node
        process = self._run.process_of(node)
        doing = "gone" if process is None else process.records[node].doing
        text = f"{node} has not answered {pending.message.verb} within {pending.timeout_s:g} s: it is {doing}"
        self._fail(pending, "timeout", f"{text}; a later answer is dropped")

    def _fail(self, pending: _Pending, code: str, text: str) -> None:
        self._forget(pending.message.id)
        self._logbook.write(logging.ERROR, f"{pending.message.verb}: {text}", pending.message.node)
        pending.deferred.answer(_error(code, text))

    def _forget(self, identifier: int) -> _Pending | None:
        pending = self._pending.pop(identifier, None)
        if pending is not None:
            pending.timer.cancel()
        return pending


def _unknown_node(word: str, known: list[str], *, several: bool) -> dict[str, Any]:
    if several:
        found = [name for name in known if is_named(name, word)]
        return _error("unknown-node", f"several nodes are called {word!r}", found)
    near = get_close_matches(word.lstrip("/"), [name.lstrip("/") for name in known], n=3, cutoff=0.5)
    names = dict.fromkeys([*(f"/{name}" for name in near), *known])
    return _error("unknown-node", f"this run has no node {word!r}", list(names))


def _error(code: str, text: str, allowed: Any = ()) -> dict[str, Any]:
    answer: dict[str, Any] = {"error": text, "code": code}
    return {**answer, "allowed": list(allowed)} if allowed else answer
