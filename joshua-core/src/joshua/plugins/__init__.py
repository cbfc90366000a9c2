"""The plugin contract: what a plugin declares, and the registry of what is installed.

A plugin module needs three names of this package: ``hookimpl``, ``Provision`` and ``ProvisionKind``.
Nothing here imports a driver; ``joshua.plugins.settings`` (pydantic) is imported only by those who use it,
and the registry, which reads the schema, at its first use: the process of a node has no need of it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from joshua.plugins.provision import Environment, Provision, ProvisionKind

if TYPE_CHECKING:
    from joshua.plugins.hooks import hookimpl
    from joshua.plugins.host import load_registry
    from joshua.plugins.registry import PluginRow, PluginStatus, Registry

__all__ = [
    "Environment",
    "PluginRow",
    "PluginStatus",
    "Provision",
    "ProvisionKind",
    "Registry",
    "hookimpl",
    "load_registry",
]

_MODULE_OF = {
    "hookimpl": "joshua.plugins.hooks",
    "load_registry": "joshua.plugins.host",
    "PluginRow": "joshua.plugins.registry",
    "PluginStatus": "joshua.plugins.registry",
    "Registry": "joshua.plugins.registry",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)
