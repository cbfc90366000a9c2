"""Fixtures of the transport tests: own ports and domains, so that runs beside each other do not meet."""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from joshua.plan import TransportSpec
from joshua.transport import open_transport
from joshua.transport.router import host_or_join

PROGRAMS = Path(__file__).parent / "programs"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="session")
def eventually():
    """Waits until a condition holds; returns what it returned."""

    def wait(condition, timeout_s=20.0, what="the condition"):
        end = time.monotonic() + timeout_s
        while not (value := condition()):
            assert time.monotonic() < end, f"{what} did not come true within {timeout_s} s"
            time.sleep(0.005)
        return value

    return wait


@pytest.fixture
def zenoh_spec():
    return TransportSpec(listen_endpoints=(f"tcp/localhost:{free_port()}",), domain_id=random.randrange(233))


@pytest.fixture
def router(zenoh_spec):
    handle = host_or_join(zenoh_spec)
    yield handle
    handle.close()


@pytest.fixture
def opener():
    """Opens transports that are closed at the end of the test."""
    opened = []

    def open_one(spec):
        opened.append(open_transport(spec))
        return opened[-1]

    yield open_one
    for transport in reversed(opened):
        transport.close()


@pytest.fixture
def program():
    """Starts programs of the folder ``programs``; they are killed at the end of the test."""
    started = []

    def start(name, *arguments, env=None):
        process = subprocess.Popen(
            [sys.executable, str(PROGRAMS / name), *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **(env or {})},
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()
