"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.api import PluginSpec, TrainerSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the trainer."""
    return [
        TrainerSpec(
            block="training",
            enum_values=("METHOD_IMITATION",),
            implementation="joshua_imitation.node:ImitationTrainer",
            settings="joshua_imitation.settings:ImitationSettings",
            summary="policies of LeRobot learn from recorded episodes",
        )
    ]
