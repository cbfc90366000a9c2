"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, SensorSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the laser scanner."""
    return [
        SensorSpec(
            block="lidar_config",
            enum_values=("PERCEPTION_LIDAR",),
            implementation="joshua_lidar.lidar:SerialLidar",
            settings="joshua_lidar.settings:LidarSettings",
            behaviour="joshua_lidar.node:LidarNode",
            data_types=("sensor_msgs/msg/LaserScan",),
            summary="RPLIDAR A1 and C1, LD06 and LD19, LDS-01, YDLIDAR X2 and X4",
        )
    ]
