"""Policies that need no training, and files that evaluate them."""

from __future__ import annotations

from pathlib import Path

import pytest
from trained_policies import write_policy, write_reaching_policy


@pytest.fixture(scope="session")
def reaching(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy that reaches some goals."""
    return write_reaching_policy(tmp_path_factory.mktemp("policies") / "reaching")


@pytest.fixture(scope="session")
def random_policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy that reaches none."""
    return write_policy(tmp_path_factory.mktemp("policies") / "random")
