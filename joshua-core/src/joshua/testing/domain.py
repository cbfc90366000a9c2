"""A ROS 2 domain that no other test uses at the same time."""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

# Domains above 101 can collide with ephemeral ports of Linux (ROS 2 documentation, "The ROS_DOMAIN_ID").
_DOMAINS = range(1, 102)


def reserve(kind: str, numbers: Sequence[int]) -> tuple[int, int]:
    """Reserve a number across all processes of this user: the one that has been free for longest.

    A killed process of an earlier test may still use the number that was freed last.

    Args:
        kind: what the numbers are, such as ``domains``.
        numbers: to choose from.

    Returns:
        The number, and a descriptor. Closing it frees the number.

    Raises:
        RuntimeError: every number is taken.
    """
    folder = Path(tempfile.gettempdir()) / f"joshua-test-{kind}-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    freed_ns = {entry.name: entry.stat().st_mtime_ns for entry in folder.iterdir()}
    candidates = random.sample(numbers, len(numbers))
    for number in sorted(candidates, key=lambda number: freed_ns.get(str(number), 0)):
        descriptor = os.open(folder / str(number), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
        else:
            return number, descriptor
    raise RuntimeError(f"tests have reserved all {kind}: see the locks in {folder}")


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Reserve a ROS 2 domain id during the context. Raises RuntimeError if none is free."""
    domain_id, descriptor = reserve("domains", _DOMAINS)
    try:
        yield domain_id
    finally:
        os.utime(descriptor)
        os.close(descriptor)
