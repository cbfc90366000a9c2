"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, SensorSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the camera."""
    return [
        SensorSpec(
            block="camera_config",
            enum_values=("PERCEPTION_CAMERA",),
            implementation="joshua_camera.camera:OpenCvCamera",
            settings="joshua_camera.settings:CameraSettings",
            behaviour="joshua_camera.node:CameraNode",
            data_types=(
                "sensor_msgs/msg/Image",
                "sensor_msgs/msg/CompressedImage",
                "sensor_msgs/msg/CameraInfo",
            ),
            summary="USB and network cameras, video files and pictures, by OpenCV",
        )
    ]
