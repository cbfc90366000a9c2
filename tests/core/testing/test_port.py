from __future__ import annotations

import socket
import subprocess
import sys

from joshua.testing.port import free_port

HUNDRED = "from joshua.testing.port import free_port; print(*(free_port() for _ in range(100)))"


def test_a_port_that_somebody_listens_on_is_left_out() -> None:
    first = free_port()
    with socket.socket() as server:
        server.bind(("127.0.0.1", first))
        assert first not in {free_port() for _ in range(150)}
    assert first in {free_port() for _ in range(150)}, "it comes again"


def test_two_processes_get_different_ones() -> None:
    here = {free_port() for _ in range(150)}
    other = subprocess.run([sys.executable, "-c", HUNDRED], capture_output=True, text=True, timeout=60)
    there = {int(port) for port in other.stdout.split()}
    assert there, other.stderr
    assert not here & there
