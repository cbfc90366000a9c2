"""Finding topics, types and nodes by what a user wrote, and naming the nearest where there is none."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.graph.session import GraphError, looks, place_of, wait_for_graph

if TYPE_CHECKING:
    from joshua.plan import QosProfile
    from joshua.transport import EndpointInfo, NodeInfo, Transport

_POLL_S = 0.05
#: How long the rest of what belongs to a topic or node may take to become known.
_SETTLE_S = 2.0


def endpoints_of(nodes: Sequence[NodeInfo], topic: str) -> list[EndpointInfo]:
    """The publishers and subscriptions of a topic."""
    return [endpoint for node in nodes for endpoint in node.endpoints if endpoint.topic == topic]


def full_topic(name: str) -> str:
    """A topic name with its leading slash."""
    return name if name.startswith("/") else f"/{name}"


def find_topic(transport: Transport, topic: str, wait_s: float) -> list[EndpointInfo]:
    """Waits for a topic to appear; returns its endpoints.

    Raises:
        GraphError: it did not; the nearest names follow.
    """
    nodes: list[NodeInfo] = []
    for _ in looks(wait_s, _POLL_S):
        nodes = transport.nodes()
        found = endpoints_of(nodes, topic)
        if found:
            # a further moment, so that the other endpoints of the topic are known as well
            return endpoints_of(wait_for_graph(transport, min(wait_s, _SETTLE_S)), topic) or found
    raise GraphError(_missing("topic", topic, _topics(nodes), transport, wait_s), ExitCode.INVALID)


def find_node(transport: Transport, name: str, wait_s: float) -> list[NodeInfo]:
    """Waits for a node to appear; returns all of that name.

    Raises:
        GraphError: it did not; the nearest names follow.
    """
    nodes: list[NodeInfo] = []
    for _ in looks(wait_s, _POLL_S):
        nodes = transport.nodes()
        found = [node for node in nodes if full_name(node) == name]
        if found:
            wait_for_graph(transport, min(wait_s, _SETTLE_S))
            return [node for node in transport.nodes() if full_name(node) == name] or found
    names = [full_name(node) for node in nodes]
    raise GraphError(_missing("node", name, names, transport, wait_s), ExitCode.INVALID)


def full_name(node: NodeInfo) -> str:
    """Fully qualified name of a node."""
    return f"{node.namespace.rstrip('/')}/{node.name}"


def type_of(endpoints: Sequence[EndpointInfo]) -> str:
    """The type of a topic.

    Raises:
        GraphError: its endpoints do not agree.
    """
    names = sorted({endpoint.type_name for endpoint in endpoints})
    if len(names) > 1:
        raise GraphError(
            f"the endpoints of {endpoints[0].topic} have several types: {', '.join(names)}; choose one with "
            "--type",
            ExitCode.INVALID,
        )
    return names[0]


def type_name(text: str) -> str:
    """The ROS 2 type of what a user wrote: a ROS 2 name or a DataType such as ``JOINT_STATE``.

    Raises:
        MessageError: there is no such type; the nearest names follow.
    """
    from joshua.messages import MessageError
    from joshua.messages.typestore import require_type
    from joshua.schema import data_types

    if "/" in text or "::" in text:
        return require_type(text)
    try:
        return data_types.type_name(data_types.number(text.upper()))
    except ValueError:
        numbers = {data_types.number(name): name for name in data_types.type_names()}
        names = {enum: full for number, full in numbers.items() for enum in data_types.enum_names(number)}
        words = {**names, **{full.rsplit("/", 1)[1]: full for full in names.values()}}
        near = difflib.get_close_matches(text, words, n=3, cutoff=0.5)
        hint = f"; the nearest are {', '.join(dict.fromkeys(words[word] for word in near))}" if near else ""
        raise MessageError(
            f"{text!r} is no message type; write package/msg/Type or a DataType such as JOINT_STATE{hint}"
        ) from None


def profile_for(publishers: Sequence[EndpointInfo], depth: int) -> QosProfile:
    """A profile that connects to all of the publishers, and gets what they keep where all keep it."""
    from joshua.plan import QosProfile

    offers = [endpoint.qos for endpoint in publishers if endpoint.is_publisher]
    best_effort = any(offer.reliability == "BEST_EFFORT" for offer in offers)
    kept = bool(offers) and all(offer.durability == "TRANSIENT_LOCAL" for offer in offers)
    return QosProfile(
        reliability="BEST_EFFORT" if best_effort else "RELIABLE",
        durability="TRANSIENT_LOCAL" if kept else "VOLATILE",
        depth=depth,
    )


def _topics(nodes: Sequence[NodeInfo]) -> list[str]:
    return sorted({endpoint.topic for node in nodes for endpoint in node.endpoints})


def _missing(kind: str, name: str, names: Sequence[str], transport: Transport, wait_s: float) -> str:
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.4)
    if near:
        hint = f"the nearest are {', '.join(near)}"
    elif names:
        hint = f"there are {', '.join(names[:8])}{', …' if len(names) > 8 else ''}"
    else:
        hint = f"there is none on {place_of(transport)}"
    return f"no {kind} {name} appeared within {wait_s:g} s; {hint}"
