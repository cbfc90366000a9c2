"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, hookimpl
from joshua_lerobot.plugin import READY_TIMEOUT_S


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the model."""
    return [
        ModelSpec(
            block="smolvla_config",
            enum_values=("SMOLVLA",),
            implementation="joshua_smolvla.model:SmolVla",
            settings="joshua_smolvla.settings:SmolVlaSettings",
            ready_timeout_s=READY_TIMEOUT_S,
            summary="SmolVLA: acts on pictures and a task in plain words",
        )
    ]
