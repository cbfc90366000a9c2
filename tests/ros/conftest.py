"""ROS 2's own rclpy beside JOSHUA: ``nox -s ros`` installs it from PyPI; without it these tests are skipped.

``JOSHUA_ROS_PYTHON`` names another interpreter that has rclpy.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
from transport_fixtures import dds_spec, domain_id, eventually, opener, program, restore_distro

__all__ = ["dds_spec", "domain_id", "eventually", "opener", "program", "restore_distro"]

PEER = Path(__file__).with_name("peer.py")
PYTHON = os.environ.get("JOSHUA_ROS_PYTHON", sys.executable)


@lru_cache(maxsize=1)
def share_of_ros() -> Path | None:
    """Folder with the descriptions of ROS 2's packages; None where rclpy is not installed."""
    code = "import rclpy, pathlib, sys; print(pathlib.Path(sys.prefix) / 'share')"
    found = subprocess.run(
        [PYTHON, "-c", code], capture_output=True, text=True, check=False, env=environment()
    )
    return Path(found.stdout.strip()) if found.returncode == 0 else None


def environment(**values: str) -> dict[str, str]:
    return {
        **os.environ,
        "ROS_DISTRO": "jazzy",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        **values,
    }


@pytest.fixture(scope="session")
def share() -> Path:
    found = share_of_ros()
    if found is None:
        pytest.skip("rclpy is not installed: nox -s ros")
    return found


class Peer:
    """A process of rclpy; its attributes are the commands of ``peer.py``."""

    def __init__(self, domain_id: int, **variables: str) -> None:
        self.process = subprocess.Popen(
            [PYTHON, str(PEER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(ROS_DOMAIN_ID=str(domain_id), **variables),
        )
        assert self._answer() == "ready"

    def __getattr__(self, command: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            assert self.process.stdin is not None
            self.process.stdin.write(json.dumps([command, arguments]) + "\n")
            self.process.stdin.flush()
            return self._answer()

        return call

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        answers, _, _ = select.select([self.process.stdout], [], [], 60)
        assert answers, "the process of rclpy does not answer: it may spin in its reader"
        line = self.process.stdout.readline()
        assert line, "the process of rclpy ended"
        return json.loads(line)


@pytest.fixture
def start_peer(share: Path, domain_id: int) -> Iterator[Callable[..., Peer]]:
    """Starts processes of rclpy in the domain of the test."""
    started: list[Peer] = []

    def start(**variables: str) -> Peer:
        started.append(Peer(domain_id, **variables))
        return started[-1]

    yield start
    for peer in started:
        if peer.process.poll() is None:
            peer.kill()


@pytest.fixture
def peer(start_peer: Callable[..., Peer]) -> Peer:
    return start_peer()
