"""The graph as lines of text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from joshua.plan import QosProfile
    from joshua.transport import EndpointInfo, NodeInfo


def qos_text(qos: QosProfile) -> str:
    """A profile in one line; durations only where they are set."""
    depth = f" {qos.depth}" if qos.history == "KEEP_LAST" else ""
    parts = [qos.reliability, qos.durability, f"{qos.history}{depth}"]
    if qos.liveliness != "AUTOMATIC":
        parts.append(qos.liveliness)
    for label, duration_s in (
        ("deadline", qos.deadline_s),
        ("lifespan", qos.lifespan_s),
        ("lease", qos.lease_duration_s),
    ):
        if duration_s:
            parts.append(f"{label} {duration_s:g} s")
    return ", ".join(parts)


def topic_lines(topic: str, endpoints: Sequence[EndpointInfo]) -> list[str]:
    """Type, hash and endpoints of a topic."""
    lines = [topic]
    for type_name, type_hash in sorted({(end.type_name, end.type_hash) for end in endpoints}):
        lines += [f"type: {type_name}", f"hash: {type_hash or 'none given'}"]
    for label, is_publisher in (("publishers", True), ("subscriptions", False)):
        chosen = [endpoint for endpoint in endpoints if endpoint.is_publisher is is_publisher]
        lines.append(f"{label}: {len(chosen)}")
        lines += [f"  {_node_of(endpoint)}  {qos_text(endpoint.qos)}" for endpoint in chosen]
    return lines


def node_lines(node: NodeInfo, name: str) -> list[str]:
    """The endpoints of a node."""
    lines = [name]
    for label, is_publisher in (("publishers", True), ("subscriptions", False)):
        chosen = [endpoint for endpoint in node.endpoints if endpoint.is_publisher is is_publisher]
        lines.append(f"{label}: {len(chosen)}")
        lines += [f"  {end.topic}  {end.type_name}  {qos_text(end.qos)}" for end in _sorted(chosen)]
    return lines


def _sorted(endpoints: Sequence[EndpointInfo]) -> list[EndpointInfo]:
    return sorted(endpoints, key=lambda endpoint: endpoint.topic)


def _node_of(endpoint: EndpointInfo) -> str:
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
