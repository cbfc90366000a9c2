"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, hookimpl
from joshua.api.specs import ExtensionSpec


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the extension of every node."""
    return [
        ExtensionSpec(
            name="ros-services",
            implementation="joshua_services.offer:offer",
            summary="ROS 2 services, parameters, lifecycle states and FollowJointTrajectory over Zenoh",
        )
    ]
