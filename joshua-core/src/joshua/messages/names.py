"""Spellings of a ROS 2 type name: ``pkg/msg/Type``, the short ``pkg/Type``, and the DDS form."""

from __future__ import annotations

import re

from joshua.messages.errors import MessageError

_ROS = re.compile(r"^([a-z][a-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)$")
_DDS = re.compile(r"^([a-z][a-z0-9_]*)::msg::dds_::([A-Z][A-Za-z0-9]*)_$")


def ros_type_name(name: str) -> str:
    """Normalises a type name to ``pkg/msg/Type``.

    Args:
        name: ``pkg/msg/Type``, ``pkg/Type`` or ``pkg::msg::dds_::Type_``.

    Raises:
        MessageError: the name has none of these forms.
    """
    match = _ROS.match(name) or _DDS.match(name)
    if match is None:
        raise MessageError(
            f"{name!r} is not a message type name; write it as package/msg/Type, "
            "such as sensor_msgs/msg/JointState"
        )
    return f"{match[1]}/msg/{match[2]}"


def dds_type_name(name: str) -> str:
    """Name that ROS 2 gives a type on the wire, such as ``std_msgs::msg::dds_::String_``.

    Raises:
        MessageError: the name is not a message type name.
    """
    package, _, base = ros_type_name(name).split("/")
    return f"{package}::msg::dds_::{base}_"


def shown_type_name(wire_name: str) -> str:
    """The ROS 2 form of any DDS type name, for lists; services and actions included."""
    return wire_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")
