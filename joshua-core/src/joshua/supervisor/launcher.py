"""Starts child processes through the fork server and reports their ends, even after the server died."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

from joshua.ipc.frames import EndOfStreamError
from joshua.ipc.process_attributes import set_child_subreaper
from joshua.supervisor.fork_server import ForkServer, ForkServerEvent
from joshua.supervisor.fork_server_process import CONTROL_DESCRIPTOR, NODE_PROGRAM
from joshua.supervisor.reactor import Reactor

#: Interval of the checks for ended children after the fork server died.
POLL_PERIOD_S = 0.01

#: Called with ``started`` or ``refused``, and after ``started`` with ``exited``.
Tell = Callable[[ForkServerEvent], None]


class Launcher:
    """Starts children and reports to each what happened to it.

    Args:
        reactor: the supervisor's loop.
        server: the fork server.
        on_server_lost: called once when the server died. Children can still be signalled and reaped.
    """

    def __init__(self, reactor: Reactor, server: ForkServer, on_server_lost: Callable[[str], None]) -> None:
        self._reactor = reactor
        self._server = server
        self._on_server_lost = on_server_lost
        self._requested: dict[int, Tell] = {}
        self._running: dict[int, Tell] = {}
        self._handles: dict[int, int] = {}
        self._lost = False
        self._descriptor = server.fileno()
        # If the server dies, its children become children of this process, which can wait for them.
        set_child_subreaper(True)
        reactor.watch(self._descriptor, self._receive)

    def start(self, tell: Tell, descriptors: tuple[int, int, int], operation: str, **values: Any) -> None:
        """Starts a child. ``operation`` and ``values`` are those of ``ForkServer.ask``."""
        if not self._lost:
            try:
                self._requested[self._server.ask(operation, descriptors, **values)] = tell
            except EndOfStreamError as error:
                self._lose(str(error))
        if self._lost:
            self._reactor.call_later(0, lambda: _refuse(tell))

    def signal(self, process_id: int, number: int) -> None:
        """Sends a signal to a child unless it has ended."""
        with contextlib.suppress(ProcessLookupError):
            if process_id in self._handles:
                signal.pidfd_send_signal(self._handles[process_id], number)  # never reaches another process
            elif process_id in self._running:
                os.kill(process_id, number)

    def close(self) -> None:
        """Stops listening. Idempotent."""
        self._reactor.forget(self._descriptor)
        while self._handles:
            os.close(self._handles.popitem()[1])
        set_child_subreaper(False)

    def _receive(self) -> None:
        try:
            for event in self._server.receive():
                self._handle(event)
        except EndOfStreamError as error:
            self._lose(str(error))

    def _handle(self, event: ForkServerEvent) -> None:
        if event.event == "started":
            tell = self._running[event.process_id] = self._requested.pop(event.request)
            if sys.platform == "linux":
                with contextlib.suppress(OSError):  # it has ended, or the kernel has no handles
                    self._handles[event.process_id] = os.pidfd_open(event.process_id)
            tell(event)
        elif event.event == "refused":
            self._requested.pop(event.request)(event)
        elif event.event == "exited":
            handle = self._handles.pop(event.process_id, None)
            if handle is not None:
                os.close(handle)
            self._running.pop(event.process_id)(event)

    def _lose(self, reason: str) -> None:
        if self._lost:
            return
        self._lost = True
        self._reactor.forget(self._descriptor)
        for tell in self._requested.values():
            _refuse(tell)
        self._requested.clear()
        self._reactor.call_later(POLL_PERIOD_S, self._poll)
        self._on_server_lost(reason)

    def _poll(self) -> None:
        for process_id in list(self._running):
            ended, status = _wait(process_id)
            if ended:
                self._handle(ForkServerEvent("exited", process_id=process_id, status=status))
        if self._running:
            self._reactor.call_later(POLL_PERIOD_S, self._poll)


def _refuse(tell: Tell) -> None:
    tell(ForkServerEvent("refused", text="the fork server has ended"))


def _wait(process_id: int) -> tuple[bool, int | None]:
    try:
        ended, status = os.waitpid(process_id, os.WNOHANG)
    except ChildProcessError:
        # No subreaper on this system: the init process reaps it, and its number vanishes.
        try:
            os.kill(process_id, 0)
        except ProcessLookupError:
            return True, None
        return False, None
    return ended != 0, status


def describe_status(status: int | None) -> str:
    """The end of a process in words."""
    if status is None:
        return "ended with an unknown status"
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"ended with exit status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"was killed by {name}"


def child_arguments(interpreter: str) -> list[str]:
    """Command line of a child that runs in another interpreter."""
    return [interpreter, "-m", NODE_PROGRAM, "--control-descriptor", str(CONTROL_DESCRIPTOR)]
