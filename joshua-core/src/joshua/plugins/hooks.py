"""The contract between the host and its plugins (pluggy hook specifications).

A plugin is a distribution with an entry point in the group ``joshua.plugins``. The module behind it
is light: it imports no driver and answers these hooks.
"""

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
