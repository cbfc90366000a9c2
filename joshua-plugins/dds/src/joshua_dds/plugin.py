"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, hookimpl
from joshua.api.specs import TransportSpec


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the DDS transport."""
    return [
        TransportSpec(
            enum_values=("TRANSPORT_DDS",),
            implementation="joshua_dds.transport:DdsTransport",
            prepare="joshua_dds.config:require_usable",
            library="cyclonedds",
            limits="Services and parameters are not offered over DDS: use `joshua call`",
            summary="ROS 2 over DDS, by the conventions of rmw_cyclonedds and rmw_fastrtps",
        )
    ]
