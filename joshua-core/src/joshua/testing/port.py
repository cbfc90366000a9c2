"""A TCP port that neither the system nor another test hands out at the same time."""

from __future__ import annotations

import errno
import fcntl
import itertools
import os
import random
import socket
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

# Linux gives ports from 32768 on to whoever asks for any port: one that was free a moment ago may be taken
# when a test uses it. Below, only programs that name a port have one; from 20000 on those of the routers.
_PORTS = range(21_000, 32_000)
_BLOCK = 100
_lock = threading.Lock()
_blocks: dict[int, Iterator[int]] = {}


def free_port() -> int:
    """A TCP port on loopback that nobody listens on; no other test process gets it as long as this one lives.

    Raises:
        RuntimeError: every port is taken.
    """
    with _lock:
        # a fork takes ports of its own
        ports = _blocks.get(os.getpid()) or _reserve()
        for port in itertools.islice(ports, _BLOCK):
            if _is_free(port):
                return port
    raise RuntimeError("every port that this process has reserved for tests is in use: see `ss -ltnp`")


def _reserve() -> Iterator[int]:
    """Reserves a block of ports for the life of this process."""
    folder = Path(tempfile.gettempdir()) / f"joshua-test-ports-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    starts = _PORTS[::_BLOCK]
    for start in random.sample(starts, len(starts)):
        descriptor = os.open(folder / str(start), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            continue
        _blocks[os.getpid()] = itertools.cycle(range(start, start + _BLOCK))
        return _blocks[os.getpid()]
    raise RuntimeError(f"every block of ports is reserved by tests: see the locks in {folder}")


def _is_free(port: int) -> bool:
    for family, address in ((socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")):
        try:
            with socket.socket(family) as probe:
                probe.bind((address, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return False  # any other error: a machine without that family of addresses
    return True
