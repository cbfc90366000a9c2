"""Who watches a run: terminal, tests and dashboards share this interface."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

from joshua.plan import RunReport
from joshua.supervisor.status import LogEntry, RunEvent, RunStatus, StartTable


class UserInterface(Protocol):
    """Hears of everything, on the supervisor's thread; each call returns at once."""

    def on_table(self, table: StartTable) -> None:
        """Every node is ready."""

    def on_status(self, status: RunStatus) -> None:
        """The regular live status."""

    def on_log(self, entry: LogEntry) -> None:
        """A line of the log, of whatever level."""

    def on_event(self, event: RunEvent) -> None:
        """A node changed its state; the log says the same in words."""

    def on_finish(self, report: RunReport) -> None:
        """The run has ended; nothing comes after this."""


class SilentInterface:
    """Shows nothing."""

    def on_table(self, table: StartTable) -> None:
        """Shows nothing."""

    def on_status(self, status: RunStatus) -> None:
        """Shows nothing."""

    def on_log(self, entry: LogEntry) -> None:
        """Shows nothing."""

    def on_event(self, event: RunEvent) -> None:
        """Shows nothing."""

    def on_finish(self, report: RunReport) -> None:
        """Shows nothing."""


class GuardedInterface:
    """Calls another interface, and cuts it off when it raises: a display must not stop a robot's nodes.

    Args:
        inner: the interface.
        report: told once why it was cut off.
    """

    def __init__(self, inner: UserInterface, report: Callable[[str], None]) -> None:
        self._inner: UserInterface = inner
        self._report = report

    def call(self, action: Callable[[UserInterface], None]) -> None:
        """Performs one call."""
        try:
            action(self._inner)
        except Exception as error:
            name = type(self._inner).__name__
            self._inner = SilentInterface()
            logging.getLogger("joshua.supervisor").debug("the user interface failed", exc_info=True)
            self._report(f"the user interface {name} failed and is cut off: {type(error).__name__}: {error}")
