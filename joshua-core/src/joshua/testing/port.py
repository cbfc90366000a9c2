"""A TCP port that neither the system nor another test uses at the same time."""

from __future__ import annotations

import errno
import itertools
import os
import socket
import threading
from collections.abc import Iterator

from joshua.testing.domain import reserve

# Linux assigns ports from 32768 on to programs that request any port, so a free one may be taken before a
# test uses it. Lower ports are used only by programs that name them, those from 20000 on by the routers.
_PORTS = range(21_000, 32_000)
_BLOCK = 100
_lock = threading.Lock()
_blocks: dict[int, Iterator[int]] = {}


def free_port() -> int:
    """Return a free TCP port on loopback, reserved for the lifetime of this process.

    Raises:
        RuntimeError: every port is taken.
    """
    with _lock:
        pid = os.getpid()  # a fork reserves its own ports
        if pid not in _blocks:
            start, _ = reserve("ports", _PORTS[::_BLOCK])  # for the life of this process
            _blocks[pid] = itertools.cycle(range(start, start + _BLOCK))
        for port in itertools.islice(_blocks[pid], _BLOCK):
            if _is_free(port):
                return port
    raise RuntimeError("every port that this process has reserved for tests is in use: run `ss -ltnp`")


def _is_free(port: int) -> bool:
    for family, address in ((socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")):
        try:
            with socket.socket(family) as probe:
                probe.bind((address, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return False  # any other error: a machine without that family of addresses
    return True
