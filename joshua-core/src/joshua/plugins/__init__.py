"""The plugin contract: what a plugin declares, and the registry of what is installed.

A plugin module needs ``hookimpl`` and the specs of what it provides. Nothing here imports a driver;
``joshua.plugins.settings`` (pydantic) is imported only by those who use it, and everything else at its first
use: the process of a node has no need of it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.plugins.hooks import hookimpl
    from joshua.plugins.host import load_registry
    from joshua.plugins.registry import PluginRow, PluginStatus, Registry
    from joshua.plugins.specs import (
        ActuatorSpec,
        DeviceSpec,
        EmulatorSpec,
        Environment,
        EnvironmentSpec,
        EpisodeWriterSpec,
        ModelSpec,
        ModeOffer,
        NodePluginSpec,
        PluginSpec,
        SensorSpec,
        SimulatorSpec,
        StoreSpec,
        TrainerSpec,
        TransportSpec,
    )

__all__ = [
    "ActuatorSpec",
    "DeviceSpec",
    "EmulatorSpec",
    "Environment",
    "EnvironmentSpec",
    "EpisodeWriterSpec",
    "ModeOffer",
    "ModelSpec",
    "NodePluginSpec",
    "PluginRow",
    "PluginSpec",
    "PluginStatus",
    "Registry",
    "SensorSpec",
    "SimulatorSpec",
    "StoreSpec",
    "TrainerSpec",
    "TransportSpec",
    "hookimpl",
    "load_registry",
]

_MODULE_OF = {"hookimpl": "hooks", "load_registry": "host"} | dict.fromkeys(
    ("PluginRow", "PluginStatus", "Registry"), "registry"
)


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_MODULE_OF.get(name, 'specs')}")
    return getattr(module, name)
