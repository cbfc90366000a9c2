"""The plugin contract: what a plugin declares, and the registry of what is installed.

Nothing here imports a driver, and only ``joshua.plugins.settings`` imports pydantic. Everything is imported
at its first use: the process of a node needs none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.plugins.discovery import PluginRow as PluginRow
    from joshua.plugins.discovery import PluginStatus as PluginStatus
    from joshua.plugins.hooks import hookimpl as hookimpl
    from joshua.plugins.host import load_registry as load_registry
    from joshua.plugins.registry import Registry as Registry
    from joshua.plugins.specs import *  # noqa: F403

_LATER = {
    "joshua.plugins.hooks": ("hookimpl",),
    "joshua.plugins.host": ("load_registry",),
    "joshua.plugins.registry": ("Registry",),
    "joshua.plugins.discovery": ("PluginRow", "PluginStatus"),
    "joshua.plugins.specs": (
        *(
            "ActuatorSpec",
            "DeviceSpec",
            "EmulatorSpec",
            "Environment",
            "EnvironmentSpec",
            "EpisodeWriterSpec",
        ),
        *("ModeOffer", "ModelSpec", "NodePluginSpec", "PluginSpec", "SensorSpec", "SimulatorSpec"),
        *("StoreSpec", "TrainerSpec", "TransportSpec"),
    ),
}

__getattr__, __dir__ = lazy_names(__name__, _LATER)
