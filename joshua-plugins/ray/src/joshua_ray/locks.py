"""Locks of files that a run holds until it ends, whatever happens to its worker."""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
import time
from pathlib import Path
from typing import IO

#: Domains above 101 can collide with ephemeral ports of Linux; 0 is the default of every program.
_DOMAINS = range(1, 102)

_POLL_S = 0.1


def wait_for(lock: IO[str], limit_s: float) -> None:
    """Take a lock that a run holds until it ends. Raises BlockingIOError if it takes longer."""
    until_s = time.monotonic() + limit_s
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > until_s:
                raise
        time.sleep(_POLL_S)


def free_domain() -> tuple[int, IO[str]]:
    """Return a ROS domain of its own for a run, whose node has the name of every other trial's, and its lock.

    Raises:
        RuntimeError: all are taken.
    """
    folder = Path(tempfile.gettempdir()) / f"joshua-sweep-domains-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    for number in random.sample(_DOMAINS, len(_DOMAINS)):
        file = (folder / str(number)).open("w")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return number, file
        except BlockingIOError:
            file.close()
    raise RuntimeError(f"{len(_DOMAINS)} trials run on this machine already")
