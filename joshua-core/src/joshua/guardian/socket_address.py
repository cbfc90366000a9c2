"""UNIX socket addresses for paths of any length."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Bytes that every system takes (``sun_path`` has 104 on macOS, 108 on Linux, with a final zero).
MAX_PATH_BYTES = 103


@contextmanager
def socket_address(path: Path) -> Iterator[str]:
    """Yields an address for ``bind`` or ``connect`` that is valid inside the context.

    Raises:
        OSError: the path is too long and the system has no ``/proc/self/fd``, or its folder is missing.
    """
    if len(os.fsencode(path)) <= MAX_PATH_BYTES:
        yield str(path)
        return
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
