"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, hookimpl
from joshua.api.specs import EmulatorSpec


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the emulated devices."""
    return [
        EmulatorSpec(
            block="sts3215_config",
            implementation="joshua_emulator.devices:ServoBusEmulator",
            summary="STS3215 servo bus on a pseudo-terminal",
        ),
        EmulatorSpec(
            block="dynamixel_config",
            implementation="joshua_emulator.devices:DynamixelBusEmulator",
            summary="Dynamixel X-series servo bus on a pseudo-terminal",
        ),
        EmulatorSpec(
            block="camera_config",
            implementation="joshua_emulator.devices:CameraEmulator",
            summary="Motion JPEG camera on loopback, with a test scene that carries frame numbers",
        ),
        EmulatorSpec(
            block="spike_motor_config",
            implementation="joshua_emulator.devices:HubEmulator",
            summary="LEGO SPIKE hub with Pybricks over virtual Bluetooth, its program run by MicroPython",
        ),
        EmulatorSpec(
            block="lidar_config",
            implementation="joshua_emulator.serial_sensors:LidarEmulator",
            summary="laser scanner in a room, on a pseudo-terminal",
        ),
        EmulatorSpec(
            block="encoder_config",
            implementation="joshua_emulator.serial_sensors:EncoderEmulator",
            summary="rotary encoders on a shaft, on a pseudo-terminal",
        ),
        EmulatorSpec(
            block="gamepad_config",
            implementation="joshua_emulator.gamepad.device:GamepadEmulator",
            summary="Xbox controller that moves by itself, its records on a UNIX socket",
        ),
    ]
