"""Fixtures for tests of robots and plugins; pytest loads them wherever joshua-core is installed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture
def joshua_domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS 2 domain of this test's own, also set as ``ROS_DOMAIN_ID``."""
    from joshua.testing.domain import reserved_domain

    with reserved_domain() as domain_id:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
        yield domain_id
