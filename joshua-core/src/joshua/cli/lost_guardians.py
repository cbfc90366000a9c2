"""Guardians of runs that left no trace: the folder of the runs has vanished, and nobody makes it again.

Such a supervisor is stopped or was killed. Its drivers and guardians still obey a latch.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from joshua.guardian.order import PROCESS_TITLE
from joshua.ipc.process_mark import ProcessMark
from joshua.ipc.run_bases import base_directories

_PROC = Path("/proc")

#: Characters of a title that the kernel keeps.
_TITLE_CHARACTERS = 15

_POLL_S = 0.02


def lost_guardians(bases: Iterable[Path]) -> list[ProcessMark]:
    """Find the guardians of this user whose runs use one of these bases; () on a system without ``/proc``.

    Args:
        bases: directories of this user's runs, in none of which a run was found.
    """
    try:
        process_ids = [int(entry.name) for entry in _PROC.iterdir() if entry.name.isdecimal()]
    except OSError:
        return []
    wanted = set(bases)
    guardians = {number for number in process_ids if _is_guardian(number)}
    return [
        ProcessMark.of(number, "guardian")
        for number in sorted(guardians)
        if _parent(number) not in guardians and wanted.intersection(_bases(number))
    ]


def await_end(marks: Sequence[ProcessMark], timeout_s: float) -> None:
    """Wait until processes have ended, or for a time."""
    deadline_s = time.monotonic() + timeout_s
    while any(mark.state != "gone" for mark in marks) and time.monotonic() < deadline_s:
        time.sleep(_POLL_S)


def _is_guardian(process_id: int) -> bool:
    try:
        folder = _PROC / str(process_id)
        title = (folder / "comm").read_text().strip()
        return title == PROCESS_TITLE[:_TITLE_CHARACTERS] and folder.stat().st_uid == os.getuid()
    except (OSError, UnicodeDecodeError):  # it has ended; or the title of another program
        return False


def _parent(process_id: int) -> int:
    try:
        stat = (_PROC / str(process_id) / "stat").read_text()
        return int(stat.rpartition(")")[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0


def _bases(process_id: int) -> list[Path]:
    """The directories that a process looks for runs in, by its environment."""
    try:
        entries = (_PROC / str(process_id) / "environ").read_bytes().split(b"\0")
    except OSError:
        return []
    pairs = [os.fsdecode(entry).partition("=") for entry in entries]
    return base_directories({name: value for name, _, value in pairs})
