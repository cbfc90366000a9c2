"""Starts child processes through the fork server and hears of their ends, even when the server has died."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from joshua.ipc.frames import EndOfStreamError
from joshua.ipc.process_attributes import set_child_subreaper
from joshua.supervisor.fork_server import ForkServer, ForkServerEvent
from joshua.supervisor.fork_server_process import CONTROL_DESCRIPTOR, NODE_PROGRAM
from joshua.supervisor.reactor import Reactor

#: Distance of two looks for dead children once the fork server is gone.
POLL_PERIOD_S = 0.01


class Launched(Protocol):
    """A child that the launcher starts."""

    def on_started(self, process_id: int) -> None:
        """It runs."""

    def on_refused(self, text: str) -> None:
        """The system refused it."""

    def on_exited(self, status: int | None) -> None:
        """It has ended; wait status, None where nobody knows it."""


class Launcher:
    """Starts children and tells each of them what became of it.

    Args:
        reactor: the supervisor's loop.
        server: the fork server.
        on_server_lost: called once when the server dies; children can still be signalled and reaped.
    """

    def __init__(self, reactor: Reactor, server: ForkServer, on_server_lost: Callable[[str], None]) -> None:
        self._reactor = reactor
        self._server = server
        self._on_server_lost = on_server_lost
        self._requested: dict[int, Launched] = {}
        self._running: dict[int, Launched] = {}
        self._handles: dict[int, int] = {}
        self._lost = False
        self._descriptor = server.fileno()
        # If the server dies, its children become ours and can be waited for.
        set_child_subreaper(True)
        reactor.watch(self._descriptor, self._receive)

    def fork(self, child: Launched, title: str, descriptors: tuple[int, int, int]) -> None:
        """Starts a child by a fork of the server."""
        self._request(child, lambda: self._server.fork(title, descriptors))

    def execute(
        self,
        child: Launched,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        descriptors: tuple[int, int, int],
    ) -> None:
        """Starts a child by another program; its control socket is ``CONTROL_DESCRIPTOR``."""
        self._request(child, lambda: self._server.execute(arguments, environment, descriptors))

    def signal(self, process_id: int, number: int) -> None:
        """Sends a signal to a child unless it has ended."""
        if process_id not in self._running:
            return
        if process_id in self._handles:
            # Straight to the process, whatever state the server is in, and never to another one.
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._handles[process_id], number)
            return
        if not self._lost:
            try:
                self._server.signal(process_id, number)
            except EndOfStreamError as error:
                self._lose(str(error))
        if self._lost:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process_id, number)

    def close(self) -> None:
        """Stops listening; a second call does nothing."""
        self._reactor.forget(self._descriptor)
        while self._handles:
            os.close(self._handles.popitem()[1])
        set_child_subreaper(False)

    def _request(self, child: Launched, ask: Callable[[], int]) -> None:
        if not self._lost:
            try:
                self._requested[ask()] = child
            except EndOfStreamError as error:
                self._lose(str(error))
        if self._lost:
            self._reactor.call_later(0, lambda: child.on_refused("the fork server has ended"))

    def _receive(self) -> None:
        try:
            for event in self._server.receive():
                self._handle(event)
        except EndOfStreamError as error:
            self._lose(str(error))

    def _handle(self, event: ForkServerEvent) -> None:
        if event.event == "started":
            child = self._requested.pop(event.request)
            self._running[event.process_id] = child
            self._open_handle(event.process_id)
            child.on_started(event.process_id)
        elif event.event == "refused":
            self._requested.pop(event.request).on_refused(event.text)
        elif event.event == "exited":
            self._end(event.process_id, event.status)

    def _open_handle(self, process_id: int) -> None:
        if sys.platform == "linux":
            with contextlib.suppress(OSError):  # gone already, or a kernel without handles
                self._handles[process_id] = os.pidfd_open(process_id)

    def _end(self, process_id: int, status: int | None) -> None:
        handle = self._handles.pop(process_id, None)
        if handle is not None:
            os.close(handle)
        self._running.pop(process_id).on_exited(status)

    def _lose(self, reason: str) -> None:
        if self._lost:
            return
        self._lost = True
        self._reactor.forget(self._descriptor)
        for child in self._requested.values():
            child.on_refused("the fork server has ended")
        self._requested.clear()
        self._reactor.call_later(POLL_PERIOD_S, self._poll)
        self._on_server_lost(reason)

    def _poll(self) -> None:
        for process_id in list(self._running):
            ended, status = _wait(process_id)
            if ended:
                self._end(process_id, status)
        if self._running:
            self._reactor.call_later(POLL_PERIOD_S, self._poll)


def _wait(process_id: int) -> tuple[bool, int | None]:
    try:
        ended, status = os.waitpid(process_id, os.WNOHANG)
    except ChildProcessError:
        # Not ours (no subreaper on this system): the init process reaps it, we only see it vanish.
        try:
            os.kill(process_id, 0)
        except ProcessLookupError:
            return True, None
        return False, None
    return ended != 0, status


def describe_status(status: int | None) -> str:
    """Says in words how a process ended."""
    if status is None:
        return "ended in an unknown way"
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
