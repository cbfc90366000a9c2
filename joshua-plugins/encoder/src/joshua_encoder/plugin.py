"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, SensorSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the rotary encoder."""
    return [
        SensorSpec(
            block="encoder_config",
            enum_values=("PERCEPTION_ENCODER",),
            implementation="joshua_encoder.encoder:SerialEncoder",
            settings="joshua_encoder.settings:EncoderSettings",
            behaviour="joshua_encoder.node:EncoderNode",
            data_types=("sensor_msgs/msg/JointState",),
            summary="rotary encoders: counts as text, AS5600 behind a microcontroller, AMT21 on RS-485",
        )
    ]
