"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, SensorSpec, hookimpl

_TYPES = ("sensor_msgs/msg/JointState", "sensor_msgs/msg/Joy")


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the gamepad and the keyboard."""
    return [
        SensorSpec(
            block="gamepad_config",
            enum_values=("PERCEPTION_GAMEPAD",),
            implementation="joshua_teleop_input.gamepad:Gamepad",
            settings="joshua_teleop_input.settings:GamepadSettings",
            behaviour="joshua_teleop_input.gamepad_node:GamepadNode",
            data_types=_TYPES,
            summary="gamepads: Linux input devices, SDL elsewhere, shared ones over a socket",
        ),
        SensorSpec(
            block="keyboard_config",
            enum_values=("PERCEPTION_KEYBOARD",),
            implementation="joshua_teleop_input.keyboard_node:KeyboardNode",
            settings="joshua_teleop_input.settings:KeyboardSettings",
            behaviour="joshua_teleop_input.keyboard_node:KeyboardNode",
            data_types=_TYPES,
            summary="the keyboard of the terminal that the run was started from",
            terminal=True,
            virtual=True,
        ),
    ]
