"""Fixtures of the transport tests: own ports and domains, so that runs beside each other do not meet."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from joshua.messages import distro, select_distro
from joshua.plan import TransportSettings
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from joshua.testing.transport import transport_settings
from joshua.transport import Transport, open_transport, prepare_transport
from joshua.transport.zenoh.router import RouterHandle

PROGRAMS = Path(__file__).parents[1] / "core/transport/programs"


@pytest.fixture(scope="session")
def eventually() -> Callable[..., Any]:
    """Waits until a condition holds; returns what it returned."""

    def wait(condition: Callable[[], Any], timeout_s: float = 60.0, what: str = "the condition") -> Any:
        end = time.monotonic() + timeout_s
        while not (value := condition()):
            assert time.monotonic() < end, f"{what} did not come true within {timeout_s} s"
            time.sleep(0.005)
        return value

    return wait


@pytest.fixture(autouse=True)
def restore_distro() -> Iterator[None]:
    before = distro()
    yield
    select_distro(before)


@pytest.fixture
def domain_id() -> Iterator[int]:
    """A ROS 2 domain that no other test uses at the same time."""
    with reserved_domain() as reserved:
        yield reserved


@pytest.fixture
def zenoh_spec(domain_id: int) -> TransportSettings:
    return TransportSettings(listen_endpoints=(f"tcp/localhost:{free_port()}",), domain_id=domain_id)


@pytest.fixture
def dds_spec(domain_id: int) -> TransportSettings:
    return transport_settings("dds", domain_id=domain_id)


@pytest.fixture
def router(zenoh_spec: TransportSettings) -> Iterator[RouterHandle]:
    handle = prepare_transport(zenoh_spec)
    assert isinstance(handle, RouterHandle)
    yield handle
    handle.close()


@pytest.fixture(params=["zenoh", "dds"])
def spec(request: pytest.FixtureRequest) -> TransportSettings:
    """A domain of its own on each transport; over Zenoh with its router."""
    made: TransportSettings = request.getfixturevalue(f"{request.param}_spec")
    if request.param == "zenoh":
        request.getfixturevalue("router")
    return made


@pytest.fixture
def opener() -> Iterator[Callable[[TransportSettings], Transport]]:
    """Opens transports that are closed at the end of the test."""
    opened: list[Transport] = []

    def open_one(spec: TransportSettings) -> Transport:
        opened.append(open_transport(spec))
        return opened[-1]

    yield open_one
    for transport in reversed(opened):
        transport.close()


@pytest.fixture
def program() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts programs of the folder ``programs``; they are killed at the end of the test."""
    started: list[subprocess.Popen[str]] = []

    def start(name: str, *arguments: object, env: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
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
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.close()
        process.stdout.close()
