"""Definitions of the ROS 2 services that nodes offer, which the message store does not have."""

from __future__ import annotations

from typing import Any

SERVICES = {
    "std_srvs/srv/Trigger": ("", "bool success\nstring message"),
    "std_srvs/srv/SetBool": ("bool data", "bool success\nstring message"),
    "rcl_interfaces/srv/ListParameters": (
        "string[] prefixes\nuint64 depth",
        "rcl_interfaces/ListParametersResult result",
    ),
    "rcl_interfaces/srv/GetParameters": ("string[] names", "rcl_interfaces/ParameterValue[] values"),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
    "rcl_interfaces/srv/DescribeParameters": (
        "string[] names",
        "rcl_interfaces/ParameterDescriptor[] descriptors",
    ),
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult[] results",
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult result",
    ),
}
"""Request and response by type."""


def service_definitions() -> tuple[dict[str, Any], dict[str, Any]]:
    """Field definitions of all requests and responses, and those that only the hashes of services need."""
    from rosbags.interfaces import Nodetype

    def name(full: str) -> Any:
        return Nodetype.NAME, full

    def field(text: str) -> tuple[str, Any]:
        kind, label = text.split()
        base = kind.removesuffix("[]")
        inner = name(base.replace("/", "/msg/")) if "/" in base else (Nodetype.BASE, (base, 0))
        return label, (Nodetype.SEQUENCE, (inner, 0)) if kind.endswith("[]") else inner

    # a message without fields has one on the wire
    empty = [field("uint8 structure_needs_at_least_one_member")]
    messages: dict[str, Any] = {}
    others: dict[str, Any] = {}
    for service, parts in SERVICES.items():
        request, response, event = (f"{service}_{part}" for part in ("Request", "Response", "Event"))
        for full, text in zip((request, response), parts, strict=True):
            messages[full] = [], [field(line) for line in text.splitlines()] or empty
        others[event] = (
            [],
            [
                ("info", name("service_msgs/msg/ServiceEventInfo")),
                ("request", (Nodetype.SEQUENCE, (name(request), 1))),
                ("response", (Nodetype.SEQUENCE, (name(response), 1))),
            ],
        )
        others[service] = (
            [],
            [
                ("request_message", name(request)),
                ("response_message", name(response)),
                ("event_message", name(event)),
            ],
        )
    return messages, others
