"""The supervisor, as one of its processes sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from joshua.ipc import messages as ipc
from joshua.plan.events import Progress

if TYPE_CHECKING:
    from joshua.supervisor.managed_process import ManagedProcess


class ProcessOwner(Protocol):
    """Hears what becomes of a process, and what its nodes ask for."""

    def on_process_configured(self, process: ManagedProcess) -> None:
        """Every node of the process is configured."""

    def on_process_ready(self, process: ManagedProcess) -> None:
        """Every node of the process is active."""

    def on_process_ended(self, process: ManagedProcess, *, failed: bool) -> None:
        """The process has ended; ``failed`` unless it was asked to."""

    def on_process_started(self, process: ManagedProcess) -> None:
        """The process exists."""

    def on_progress(self, progress: Progress) -> None:
        """A node says how far its work is."""

    def on_first_message(self, stamp_ns: int) -> None:
        """A subscription has received its first message."""

    def on_fault(self, node: str, text: str) -> None:
        """The device of a node does nothing until it is resumed; "" ends that."""

    def on_reply(self, message: ipc.CallReply) -> None:
        """A node has answered to a call."""

    def on_shown(self) -> None:
        """A node tells people something of itself."""

    def on_stop_run(self, node: str, reason: str) -> None:
        """A node asks for the end of the run."""
