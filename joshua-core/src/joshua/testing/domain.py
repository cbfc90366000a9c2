"""A ROS 2 domain that no other test uses at the same time."""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Domains above 101 can meet the ephemeral ports of Linux (ROS 2 documentation, «The ROS_DOMAIN_ID»).
_DOMAINS = range(1, 102)


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Reserves a ROS 2 domain id for the time of the context, across all processes of this user.

    The one that has been free for longest: what an earlier test has killed may still be on its way out.

    Raises:
        RuntimeError: every domain is taken.
    """
    folder = Path(tempfile.gettempdir()) / f"joshua-test-domains-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    candidates = random.sample(_DOMAINS, len(_DOMAINS))
    for domain_id in sorted(candidates, key=lambda number: _freed_ns(folder / str(number))):
        descriptor = os.open(folder / str(domain_id), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            continue
        try:
            yield domain_id
        finally:
            os.utime(descriptor)
            os.close(descriptor)
        return
    raise RuntimeError(f"all ROS 2 domains from 1 to 101 are reserved by tests: see the locks in {folder}")


def _freed_ns(lock: Path) -> int:
    """When a domain was free again; 0 for one that was never reserved."""
    try:
        return lock.stat().st_mtime_ns
    except FileNotFoundError:
        return 0
