"""The core as a plugin: mock devices, the random-noise model and Zenoh, declared like anyone else's."""

from __future__ import annotations

from joshua.plugins import ActuatorSpec, PluginSpec, SensorSpec, TransportSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Names the mock devices and the Zenoh transport."""
    return [
        ActuatorSpec(
            block="mock_motor_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE", "ACTION_MOCK"),
            implementation="joshua.mock.actuator:MockActuator",
            settings="joshua.mock.settings:MockMotorSettings",
            summary="virtual motors with first-order motion",
            virtual=True,
        ),
        SensorSpec(
            block="mock_camera_config",
            enum_values=("PERCEPTION_CAMERA",),
            implementation="joshua.mock.sensors:MockCamera",
            settings="joshua.mock.settings:MockCameraSettings",
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
            implementation="joshua.mock.sensors:MockEncoder",
            settings="joshua.mock.settings:MockEncoderSettings",
            data_types=("sensor_msgs/msg/JointState",),
            summary="rotary encoder that turns at a constant speed",
            virtual=True,
        ),
        SensorSpec(
            block="mock_lidar_config",
            enum_values=("PERCEPTION_LIDAR",),
            implementation="joshua.mock.sensors:MockLidar",
            settings="joshua.mock.settings:MockLidarSettings",
            data_types=("sensor_msgs/msg/LaserScan",),
            summary="laser scanner in a rectangular room",
            virtual=True,
        ),
        TransportSpec(
            enum_values=("TRANSPORT_ZENOH",),
            implementation="joshua.transport.zenoh.transport:ZenohTransport",
            prepare="joshua.transport.zenoh.router:prepare",
            summary="ROS 2 over Zenoh, by the conventions of rmw_zenoh",
        ),
    ]
