from __future__ import annotations

import pytest
from joshua.testing import resources


@pytest.fixture(autouse=True)
def little_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    """What these devices leave, they leave for good; nothing that is to go goes later than it is closed."""
    monkeypatch.setattr(resources, "GRACE_S", 0.3)
