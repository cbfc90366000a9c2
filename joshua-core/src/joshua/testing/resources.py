"""File handles and threads of this process: what a device opened, and what it left behind."""

from __future__ import annotations

import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

#: Time that a thread or handle may take to go after the device was closed, on a machine that stalls, too.
GRACE_S = 10.0

_DESCRIPTORS = Path("/proc/self/fd" if sys.platform == "linux" else "/dev/fd")


@dataclass(frozen=True)
class Resources:
    """What the process holds at one moment: file handles with what they lead to, and threads."""

    handles: frozenset[tuple[int, str]]
    threads: frozenset[threading.Thread]

    def since(self, before: Resources) -> str:
        """What is new since an earlier moment, in words; "" where nothing is."""
        handles = sorted(target for _, target in self.handles - before.handles)
        threads = sorted(thread.name for thread in self.threads - before.threads if thread.is_alive())
        parts = [
            f"{len(names)} {word}{'s' * (len(names) > 1)} ({', '.join(names)})"
            for word, names in (("file handle", handles), ("thread", threads))
            if names
        ]
        return " and ".join(parts)


def take() -> Resources:
    """The resources of this process now."""
    handles = set()
    for entry in list(_DESCRIPTORS.iterdir()):
        try:
            target = str(entry.readlink()) if sys.platform == "linux" else entry.name
            os.fstat(int(entry.name))
        except OSError:
            continue  # the handle that lists the folder, or one that another thread closed meanwhile
        handles.add((int(entry.name), target))
    return Resources(frozenset(handles), frozenset(threading.enumerate()))


def left_since(before: Resources) -> str:
    """What is still there that was not before, after a time of grace; "" where nothing is."""
    end = time.monotonic() + GRACE_S
    while (left := take().since(before)) and time.monotonic() < end:
        time.sleep(0.02)
    return left
