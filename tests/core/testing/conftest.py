from __future__ import annotations

import broken_actuators
import pytest
from joshua.testing import resources


@pytest.fixture(autouse=True)
def little_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    """What these devices leave, they leave for good; nothing that is to go goes later than it is closed."""
    monkeypatch.setattr(resources, "GRACE_S", 0.3)


@pytest.fixture(autouse=True)
def first_stamp_is_of_this_test() -> None:
    """One that is minutes old, for another test has taken it on a slow machine, breaks another clause."""
    broken_actuators.first_stamp_ns.cache_clear()
