"""Waiting for what another thread or process brings about, however slow the machine is."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def eventually(look: Callable[[], T], what: str = "it", timeout_s: float = 60.0) -> T:
    """Looks until what is seen is true; returns it."""
    deadline_s = time.monotonic() + timeout_s
    while not (seen := look()):
        assert time.monotonic() < deadline_s, f"{what} did not come about"
        time.sleep(0.01)
    return seen
