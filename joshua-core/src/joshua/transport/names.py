"""The ROS 2 rules for names of nodes, namespaces and topics.

Source: ROS 2 design, "Topic and Service name mapping to DDS".
"""

from __future__ import annotations

import re

from joshua.transport.errors import TransportError

_TOPIC = re.compile(r"^(/[A-Za-z_][A-Za-z0-9_]*)+$")
_NODE = re.compile(r"^[A-Za-z_][A-Za-z0-9_]*$")

#: Name that ROS 2 gives to the node of DDS endpoints that no node has announced as its own.
NAMELESS = "_CREATED_BY_BARE_DDS_APP_"


def require_topic(topic: str) -> str:
    """Returns a fully qualified topic name as it is.

    Raises:
        TransportError: not a fully qualified ROS 2 topic name.
    """
    if not _TOPIC.match(topic) or "__" in topic:
        raise TransportError(
            f"{topic!r} is not a fully qualified topic name; write parts of letters, digits and single "
            "underscores that do not begin with a digit, each after a slash, such as /leader/joint_states"
        )
    return topic


def require_node(name: str, namespace: str) -> tuple[str, str]:
    """Returns node name and namespace as they are.

    Raises:
        TransportError: not a ROS 2 node name, or not a namespace with a leading slash.
    """
    if not _NODE.match(name):
        raise TransportError(
            f"{name!r} is not a node name; write letters, digits and underscores, no digit first, "
            "such as leader_arm"
        )
    if namespace != "/" and (not _TOPIC.match(namespace) or "__" in namespace):
        raise TransportError(f"{namespace!r} is not a namespace; write / or a path such as /left")
    return name, namespace
