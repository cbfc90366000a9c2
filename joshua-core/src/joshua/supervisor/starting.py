"""Runs that are starting. Each holds the lock of a file, because reading and checking its configuration takes
a second or more before it has a run directory.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from joshua.ipc.client import is_free
from joshua.ipc.run_bases import RunDirectoryError, private

FOLDER_NAME = "starting"
_SUFFIX = ".run"


@contextlib.contextmanager
def starting(base: Path) -> Iterator[None]:
    """Marks this process as starting a run inside the block. Not before a fork, which would keep the lock."""
    try:
        path = private(private(base) / FOLDER_NAME) / f"{os.getpid()}{_SUFFIX}"
        unlocked = path.with_suffix(".new")
        descriptor = os.open(unlocked, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except (OSError, RunDirectoryError):  # the run reports it
        yield
        return
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            unlocked.replace(path)  # visible only when locked
        yield
    finally:
        with contextlib.suppress(OSError):  # a file system that is read-only by now; the lock decides
            path.unlink(missing_ok=True)
        os.close(descriptor)


def started_processes(bases: Sequence[Path]) -> set[int]:
    """Process ids of this user's runs, including starting ones. Removes files of killed runs."""
    paths = [path for base in bases for path in (base / FOLDER_NAME).glob(f"*{_SUFFIX}")]
    free = [path for path in paths if is_free(path)]
    for path in free:
        with contextlib.suppress(OSError):  # a read-only file system
            path.unlink(missing_ok=True)
    return {int(path.stem) for path in paths if path not in free}
