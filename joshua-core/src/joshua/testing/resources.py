"""File handles and threads of this process that a device opened or left behind."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

#: Time limit for a thread or handle to end after the device was closed, also during a system stall.
GRACE_S = 10.0

_DESCRIPTORS = Path("/proc/self/fd" if sys.platform == "linux" else "/dev/fd")


@dataclass(frozen=True)
class Resources:
    """Resources of the process at one moment: file handles with their targets, and threads."""

    handles: frozenset[tuple[int, str]]
    threads: frozenset[threading.Thread]

    def since(self, before: Resources) -> str:
        """Describe what was added since an earlier moment; "" for nothing."""
        handles = sorted(target for _, target in self.handles - before.handles)
        threads = sorted(thread.name for thread in self.threads - before.threads if thread.is_alive())
        parts = [
            f"{len(names)} {word}{'s' * (len(names) > 1)} ({', '.join(names)})"
            for word, names in (("file handle", handles), ("thread", threads))
            if names
        ]
        return " and ".join(parts)


def take() -> Resources:
    """Return the resources of this process."""
    handles = set()
    for entry in list(_DESCRIPTORS.iterdir()):
        try:
            target = str(entry.readlink()) if sys.platform == "linux" else entry.name
            os.fstat(int(entry.name))
        except OSError:
            continue  # the handle of the listing itself, or one that another thread closed meanwhile
        handles.add((int(entry.name), target))
    return Resources(frozenset(handles), frozenset(threading.enumerate()))


def left_since(before: Resources) -> str:
    """Describe new resources that remain after a grace period; "" for none."""
    end = time.monotonic() + GRACE_S
    while (left := take().since(before)) and time.monotonic() < end:
        time.sleep(0.02)
    return left


@contextmanager
def opened_by_constructor(kind: type) -> Iterator[list[str]]:
    """Collect resources that the constructor of a class opens, without those of its factory."""
    inherited: Callable[..., None] = kind.__init__  # type: ignore[misc]
    own = "__init__" in vars(kind)
    opened: list[str] = []

    def construct(self: object, *arguments: object, **named: object) -> None:
        before = take()
        inherited(self, *arguments, **named)
        opened.append(take().since(before))

    kind.__init__ = construct  # type: ignore[misc]
    try:
        yield opened
    finally:
        if own:
            kind.__init__ = inherited  # type: ignore[misc]
        else:
            del kind.__init__  # type: ignore[misc]


def disconnect_since(before: Resources) -> None:
    """Cut every handle opened since a moment, as if the process had been killed."""
    null = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for handle, target in take().handles - before.handles - {(null, os.devnull)}:
        with suppress(OSError):  # closed meanwhile
            if not target.startswith("socket:"):
                os.dup2(null, handle, inheritable=False)
                continue
            with socket.socket(fileno=os.dup(handle)) as link:  # also an emulator's end of the link
                link.shutdown(socket.SHUT_RDWR)
    os.close(null)
