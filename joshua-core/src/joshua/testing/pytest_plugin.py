"""Fixtures for tests of robots and plugins. pytest loads them if joshua-core is installed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from joshua.testing.program import JoshuaProgram


@pytest.fixture
def joshua_domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS 2 domain for this test only, also set as ``ROS_DOMAIN_ID``."""
    from joshua.testing.domain import reserved_domain

    with reserved_domain() as domain_id:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
        yield domain_id


@pytest.fixture
def joshua_run(tmp_path: Path, joshua_domain_id: int) -> Iterator[JoshuaProgram]:
    """The program ``joshua`` in a child process: ``joshua_run("--config", "robot.pbtxt").returncode``."""
    from joshua.testing.program import JoshuaProgram

    program = JoshuaProgram(tmp_path, joshua_domain_id)
    try:
        yield program
    finally:
        program.close()
