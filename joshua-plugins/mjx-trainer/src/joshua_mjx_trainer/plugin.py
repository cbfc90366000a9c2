"""Declares the plugin of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, TrainerSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the trainer."""
    return [
        TrainerSpec(
            block="training",
            enum_values=("BACKEND_MJX",),
            implementation="joshua_mjx_trainer.node:MjxTrainer",
            settings="joshua_mjx_trainer.settings:MjxSettings",
            summary="PPO on an accelerator, in thousands of environments on MuJoCo XLA",
        )
    ]
