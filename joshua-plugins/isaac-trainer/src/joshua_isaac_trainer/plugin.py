"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, TrainerSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the trainer."""
    return [
        TrainerSpec(
            block="training",
            enum_values=("BACKEND_ISAAC",),
            implementation="joshua_isaac_trainer.node:IsaacTrainer",
            settings="joshua_isaac_trainer.settings:IsaacSettings",
            summary="PPO in NVIDIA Isaac Lab, in thousands of environments on a GPU",
        ),
    ]
