"""The plugin contract: what a plugin declares, and the registry of what is installed.

A plugin module needs three names of this package: ``hookimpl``, ``Provision`` and ``ProvisionKind``.
Nothing here imports a driver; ``joshua.plugins.settings`` (pydantic) is imported only by those who use it.
"""

from joshua.plugins.hooks import hookimpl
from joshua.plugins.host import load_registry
from joshua.plugins.provision import Provision, ProvisionKind
from joshua.plugins.registry import PluginRow, PluginStatus, Registry

__all__ = [
    "PluginRow",
    "PluginStatus",
    "Provision",
    "ProvisionKind",
    "Registry",
    "hookimpl",
    "load_registry",
]
