"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, hookimpl

#: Time to download a checkpoint, to load it and to compile it.
READY_TIMEOUT_S = 1800.0


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the policies."""
    return [
        ModelSpec(
            block="joshua.LeRobotPolicy",
            message_module="joshua_lerobot.lerobot_pb2",
            enum_values=("MODEL_PLUGIN",),
            implementation="joshua_lerobot.policy:LeRobotModel",
            settings="joshua_lerobot.settings:LeRobotSettings",
            ready_timeout_s=READY_TIMEOUT_S,
            summary="any policy of the installed LeRobot",
        )
    ]
