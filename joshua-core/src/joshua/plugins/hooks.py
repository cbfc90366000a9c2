"""The hooks of the entry points of the group ``joshua.plugins``, whose light modules import no driver."""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from joshua.plugins.specs import PluginSpec

PROJECT_NAME = "joshua"

hookspec = pluggy.HookspecMarker(PROJECT_NAME)
hookimpl = pluggy.HookimplMarker(PROJECT_NAME)


class PluginHooks:
    """Hooks that a plugin may implement."""

    @hookspec
    def joshua_specs(self) -> Iterable[PluginSpec]:
        """Names what the plugin provides."""
        raise NotImplementedError
