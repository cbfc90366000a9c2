"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ActuatorSpec, PluginSpec, SensorSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the mock devices."""
    return [
        ActuatorSpec(
            block="mock_motor_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE", "ACTION_MOCK"),
            implementation="joshua_mock.actuator:MockActuator",
            settings="joshua_mock.settings:MockMotorSettings",
            summary="virtual motors with first-order motion",
            virtual=True,
        ),
        SensorSpec(
            block="mock_camera_config",
            enum_values=("PERCEPTION_CAMERA",),
            implementation="joshua_mock.sensors:MockCamera",
            settings="joshua_mock.settings:MockCameraSettings",
            data_types=(
                "sensor_msgs/msg/Image",
                "sensor_msgs/msg/CompressedImage",
                "sensor_msgs/msg/CameraInfo",
            ),
            summary="moving test pattern that carries its frame number",
            virtual=True,
        ),
        SensorSpec(
            block="mock_encoder_config",
            enum_values=("PERCEPTION_ENCODER",),
            implementation="joshua_mock.sensors:MockEncoder",
            settings="joshua_mock.settings:MockEncoderSettings",
            data_types=("sensor_msgs/msg/JointState",),
            summary="rotary encoder that turns at a constant speed",
            virtual=True,
        ),
        SensorSpec(
            block="mock_lidar_config",
            enum_values=("PERCEPTION_LIDAR",),
            implementation="joshua_mock.sensors:MockLidar",
            settings="joshua_mock.settings:MockLidarSettings",
            data_types=("sensor_msgs/msg/LaserScan",),
            summary="laser scanner in a rectangular room",
            virtual=True,
        ),
    ]
