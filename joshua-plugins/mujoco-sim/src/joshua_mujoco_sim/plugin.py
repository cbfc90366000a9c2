"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.plugins.hooks import hookimpl
from joshua.plugins.provision import Provision


@hookimpl
def joshua_provisions() -> list[Provision]:
    """Names what simulates; models are listed by ``joshua models``."""
    return []
