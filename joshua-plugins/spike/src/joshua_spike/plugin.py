"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ActuatorSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the driver of SPIKE hubs."""
    return [
        ActuatorSpec(
            block="spike_motor_config",
            enum_values=("ACTION_SPIKE", "ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="joshua_spike.actuator:SpikeActuator",
            settings="joshua_spike.settings:SpikeSettings",
            stops_itself=True,
            hang_after_s=1.5,  # longer than the second that a read waits; the hub stops the motors earlier
            ready_timeout_s=100.0,  # longer than all attempts to find and connect together
            summary="LEGO SPIKE motors on a hub with Pybricks, by Bluetooth",
        )
    ]
