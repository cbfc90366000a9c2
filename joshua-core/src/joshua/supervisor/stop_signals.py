"""SIGINT, SIGTERM and SIGHUP as events of the supervisor's loop."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable
from typing import Any

from joshua.supervisor.reactor import Reactor

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

#: A signal so soon after another is the same order, delivered twice: ``timeout`` tells the process and its
#: whole group, and of a terminal that closes both the kernel and the shell tell.
ECHO_S = 0.2


class StopSignals:
    """Turns signals into calls on the loop while it is installed; main thread only.

    Args:
        reactor: the supervisor's loop.
        on_signal: called with the number of each signal that is no echo of the one before.
    """

    def __init__(self, reactor: Reactor, on_signal: Callable[[int], None]) -> None:
        self._reactor = reactor
        self._on_signal = on_signal
        self._former: dict[int, Any] = {}
        self._former_descriptor = -1
        self._receiver, self._sender = socket.socketpair()
        self._heard_s = float("-inf")

    def install(self) -> None:
        """Takes over the signals."""
        self._receiver.setblocking(False)
        self._sender.setblocking(False)
        for number in STOP_SIGNALS:
            self._former[number] = signal.signal(number, lambda _number, _frame: None)
        self._former_descriptor = signal.set_wakeup_fd(self._sender.fileno(), warn_on_full_buffer=False)
        self._reactor.watch(self._receiver.fileno(), self._read)

    def close(self) -> None:
        """Gives the signals back; a second call does nothing."""
        if self._former:
            signal.set_wakeup_fd(self._former_descriptor)
            for number, handler in self._former.items():
                signal.signal(number, handler)
            self._former.clear()
            self._reactor.forget(self._receiver.fileno())
        self._receiver.close()
        self._sender.close()

    def _read(self) -> None:
        try:
            numbers = self._receiver.recv(64)
        except BlockingIOError:
            return
        for number in numbers:
            if number not in STOP_SIGNALS:
                continue
            now_s = self._reactor.now_s()
            if now_s - self._heard_s > ECHO_S:
                self._heard_s = now_s
                self._on_signal(number)
