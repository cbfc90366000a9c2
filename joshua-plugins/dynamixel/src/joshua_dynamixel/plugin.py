"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ActuatorSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the driver of Dynamixel buses."""
    return [
        ActuatorSpec(
            block="dynamixel_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="joshua_dynamixel.actuator:DynamixelActuator",
            settings="joshua_dynamixel.settings:DynamixelSettings",
            safe_stop="joshua_dynamixel.safe_stop:DynamixelStopRequest",
            bus_tools="joshua_dynamixel.bus_tools:DynamixelBusTools",
            summary="Dynamixel X-series servo bus",
        )
    ]
