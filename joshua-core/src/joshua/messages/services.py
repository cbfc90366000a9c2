"""Definitions of the ROS 2 services that nodes offer and the message store lacks."""

from __future__ import annotations

from collections.abc import Mapping
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
    "lifecycle_msgs/srv/GetState": ("", "lifecycle_msgs/State current_state"),
    "lifecycle_msgs/srv/ChangeState": ("lifecycle_msgs/Transition transition", "bool success"),
    "lifecycle_msgs/srv/GetAvailableStates": ("", "lifecycle_msgs/State[] available_states"),
    "lifecycle_msgs/srv/GetAvailableTransitions": (
        "",
        "lifecycle_msgs/TransitionDescription[] available_transitions",
    ),
}
"""Request and response by type."""

_MESSAGES: dict[str, str] = {}


def define(services: Mapping[str, tuple[str, str]], messages: Mapping[str, str]) -> None:
    """Add types that the message store lacks, for a plugin.

    Args:
        services: request and response by type. Those of actions are called ``pkg/action/Name_SendGoal`` and
        so on.
        messages: fields by type, one ``type name`` per line, without constants.
    """
    from joshua.messages.typestore import forget_services

    SERVICES.update(services)
    _MESSAGES.update(messages)
    forget_services()


def service_definitions() -> tuple[dict[str, Any], dict[str, Any]]:
    """Field definitions of all requests and responses, and those needed only to hash services."""
    from rosbags.interfaces import Nodetype

    def name(full: str) -> Any:
        return Nodetype.NAME, full

    def field(text: str) -> tuple[str, Any]:
        kind, label = text.split()
        base = kind.removesuffix("[]")
        full = base.replace("/", "/msg/") if base.count("/") == 1 else base
        inner = name(full) if "/" in base else (Nodetype.BASE, (base, 0))
        return label, (Nodetype.SEQUENCE, (inner, 0)) if kind.endswith("[]") else inner

    # a message without fields has one on the wire
    empty = [field("uint8 structure_needs_at_least_one_member")]
    messages: dict[str, Any] = {
        full: ([], [field(line) for line in text.splitlines()]) for full, text in _MESSAGES.items()
    }
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
