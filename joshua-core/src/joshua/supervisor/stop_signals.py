"""SIGINT, SIGTERM and SIGHUP as events of the supervisor's loop."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

from joshua.supervisor.reactor import Reactor

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

#: A signal so soon after another is the same order twice: ``timeout`` signals the process and its group, and
#: kernel and shell both report a closed terminal.
ECHO_S = 0.2


class StopSignals:
    """Turns signals into calls on the loop while it is installed. Main thread only.

    Args:
        reactor: the supervisor's loop.
        on_signal: called with the number of each signal that does not repeat the one before.
    """

    def __init__(self, reactor: Reactor, on_signal: Callable[[int], None]) -> None:
        self._reactor = reactor
        self._on_signal = on_signal
        self._former: dict[int, Any] = {}
        self._former_descriptor = -1
        self._received_s = float("-inf")

    def install(self) -> None:
        """Takes over the signals."""
        for number in STOP_SIGNALS:
            self._former[number] = signal.signal(
                number, lambda number, _frame: self._reactor.post(lambda: self._receive(number))
            )
        # The kernel's side of a signal wakes the loop, so that the handler above gets its turn.
        self._former_descriptor = signal.set_wakeup_fd(
            self._reactor.wake_descriptor, warn_on_full_buffer=False
        )

    def close(self) -> None:
        """Restores the former handlers. Idempotent."""
        if self._former:
            signal.set_wakeup_fd(self._former_descriptor)
        while self._former:
            signal.signal(*self._former.popitem())

    def _receive(self, number: int) -> None:
        now_s = self._reactor.now_s()
        if now_s - self._received_s > ECHO_S:
            self._received_s = now_s
            self._on_signal(number)
