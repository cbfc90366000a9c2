"""Runs that are just being started: from its first moment on, each holds the lock of a file of its own.

The directory of a run exists only once its file is read and checked, which takes a second or more.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from joshua.ipc.run_bases import RunDirectoryError, private

FOLDER_NAME = "starting"
_SUFFIX = ".run"


@contextlib.contextmanager
def starting(base: Path) -> Iterator[None]:
    """Shows for the length of the block that this process starts a run; where it cannot, the run says why.

    Not before a fork, which would hold the lock as well.
    """
    try:
        path = private(private(base) / FOLDER_NAME) / f"{os.getpid()}{_SUFFIX}"
        unlocked = path.with_suffix(".new")
        descriptor = os.open(unlocked, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except (OSError, RunDirectoryError):
        yield
        return
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            unlocked.replace(path)  # whoever finds it there finds it locked
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def started_processes(bases: Sequence[Path]) -> set[int]:
    """Process ids of this user's runs, those that only start included; removes what killed ones have left."""
    paths = [path for base in bases for path in (base / FOLDER_NAME).glob(f"*{_SUFFIX}")]
    return {int(path.stem) for path in paths if _is_held(path)}


def _is_held(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False  # it has just gone
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    path.unlink(missing_ok=True)
    return False
