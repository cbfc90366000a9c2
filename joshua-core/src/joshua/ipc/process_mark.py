"""Marks of processes that stay valid: a process id is used again, a start time is not."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

_PROC = Path("/proc")
_END_POLL_S = 0.005

#: ``unknown``: this system does not show the start of a process.
ProcessState = Literal["running", "stopped", "gone", "unknown"]


@dataclass(frozen=True)
class ProcessMark:
    """One process.

    Attributes:
        process_id: its id; name: for people, such as ``driver``.
        started: clock ticks from the start of the system to its own; -1 if the system does not show it.
        boot: start of the system in which the ticks count; namespace: in which the id counts.
    """

    process_id: int
    name: str
    started: int
    boot: str
    namespace: str

    @classmethod
    def of(cls, process_id: int, name: str) -> ProcessMark:
        """Mark of a living process of this program."""
        started, _ = _stat(process_id)
        return cls(process_id, name, started, _boot(), _namespace())

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> ProcessMark:
        """Reads the result of ``to_values``. Raises TypeError."""
        return cls(**values)

    def to_values(self) -> dict[str, Any]:
        """Values as in JSON."""
        return asdict(self)

    def __str__(self) -> str:
        return f"{self.name} (process {self.process_id})"

    @property
    def state(self) -> ProcessState:
        """What it does; ``gone`` also if another process has its id."""
        if self.boot and self.boot != _boot():
            return "gone"
        if self.started < 0 or self.namespace != _namespace():
            return "unknown"
        started, letter = _stat(self.process_id)
        if started != self.started or letter in ("Z", "X"):
            return "gone"
        return "stopped" if letter == "T" else "running"

    def kill(self, timeout_s: float, *, with_children: bool = False) -> bool:
        """Kills the process, and returns whether it has ended in time. Kills no other process with its id.

        Args:
            with_children: also those that it has forked, such as the action of a guardian.
        """
        marks = [self]
        if with_children and self.state in ("running", "stopped"):
            marks += [ProcessMark.of(child, self.name) for child in _children(self.process_id)]
        for mark in marks:
            mark._send_kill()
        deadline_s = time.monotonic() + timeout_s
        while any(mark.state in ("running", "stopped") for mark in marks):
            if time.monotonic() > deadline_s:
                return False
            time.sleep(_END_POLL_S)
        return self.state == "gone"

    def _send_kill(self) -> None:
        if self.state not in ("running", "stopped"):
            return
        with contextlib.suppress(OSError):  # it has ended, or belongs to another user
            try:
                descriptor = os.pidfd_open(self.process_id)
            except OSError as error:
                if error.errno != errno.ENOSYS:
                    raise
                os.kill(self.process_id, signal.SIGKILL)  # Linux before 5.3
                return
            try:
                # The descriptor stays with one process, also if its id is used again after the check.
                if self.state in ("running", "stopped"):
                    signal.pidfd_send_signal(descriptor, signal.SIGKILL)
            finally:
                os.close(descriptor)


def _stat(process_id: int) -> tuple[int, str]:
    """Start in clock ticks and letter of the state; (-1, "") if there is no such process, or no ``/proc``."""
    try:
        words = (_PROC / str(process_id) / "stat").read_text().rpartition(")")[2].split()
        return int(words[19]), words[0]
    except (OSError, ValueError, IndexError):
        return -1, ""


def _boot() -> str:
    try:
        return (_PROC / "sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


def _namespace() -> str:
    try:
        return os.readlink(_PROC / "self/ns/pid")  # noqa: PTH115 (a link to a name)
    except OSError:
        return ""


def _children(process_id: int) -> list[int]:
    found = []
    for path in _PROC.glob(f"{process_id}/task/*/children"):
        with contextlib.suppress(OSError):
            found += [int(word) for word in path.read_text().split()]
    return found
