"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ActuatorSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the driver of STS3215 buses."""
    return [
        ActuatorSpec(
            block="sts3215_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="joshua_sts3215.actuator:Sts3215Actuator",
            settings="joshua_sts3215.settings:Sts3215Settings",
            safe_stop="joshua_sts3215.safe_stop:Sts3215StopRequest",
            bus_tools="joshua_sts3215.bus_tools:Sts3215BusTools",
            summary="Feetech/Waveshare STS3215 servo bus",
        )
    ]
