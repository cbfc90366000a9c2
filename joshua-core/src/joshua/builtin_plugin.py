"""The core as a plugin: Zenoh, declared like any other transport."""

from __future__ import annotations

from joshua.plugins import PluginSpec, TransportSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Declare the Zenoh transport."""
    return [
        TransportSpec(
            enum_values=("TRANSPORT_ZENOH",),
            implementation="joshua.transport.zenoh.transport:ZenohTransport",
            prepare="joshua.transport.zenoh.router:prepare",
            summary="ROS 2 over Zenoh, by the conventions of rmw_zenoh",
        ),
    ]
