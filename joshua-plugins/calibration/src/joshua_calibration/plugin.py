"""What this distribution provides to the host: no block of a file; it brings a command."""

from __future__ import annotations

from joshua.plugins import PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Names nothing that a block asks for."""
    return []
