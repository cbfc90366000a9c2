"""Makes the graph of a configuration, with resolved topic names and effective QoS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

from joshua.config.names import topic_fault
from joshua.plan.graph import Endpoint, NodeEntry, RobotGraph
from joshua.plan.qos import QosProfile
from joshua.schema import config_pb2 as pb

DEFAULT_DEPTH = 10


def build_graph(config: pb.Config) -> RobotGraph:
    """Make the graph of a configuration's nodes. The planner adds the services of its mode."""
    entries = tuple(node_entries(config))
    publishers = [
        _endpoint(entry, f"{entry.path}.publishers[{index}]", block, is_publisher=True)
        for entry in entries
        for index, block in enumerate(entry.node.publishers)
    ]
    adopted: dict[str, QosProfile] = {}
    for publisher in publishers:
        known = adopted.get(publisher.topic)
        adopted[publisher.topic] = publisher.qos if known is None else common_profile(known, publisher.qos)
    subscriptions = [
        _endpoint(entry, f"{entry.path}.subscriptions[{index}]", block, is_publisher=False, adopted=adopted)
        for entry in entries
        for index, block in enumerate(entry.node.subscriptions)
    ]
    replays = config.ai.data_store.operation == pb.DATA_STORE_REPLAY
    replays = replays and config.general.mode == pb.MODE_DATA_STORE
    return RobotGraph(entries, (*publishers, *subscriptions), replays=replays)


def offered_profile(graph: RobotGraph, topic: str) -> QosProfile:
    """The profile of a subscription without one: what the topic's publishers have in common."""
    offered = [item.qos for item in graph.endpoints if item.is_publisher and item.topic == topic]
    return reduce(common_profile, offered) if offered else QosProfile()


def node_entries(config: pb.Config) -> Iterator[NodeEntry]:
    """Yield every node block of actions, perceptions and models, in the order of the file."""
    groups: tuple[tuple[str, Sequence[Any]], ...] = (
        ("robot.actions", config.robot.actions),
        ("robot.perceptions", config.robot.perceptions),
        ("ai.models", config.ai.models),
    )
    for name, group in groups:
        for index, owner in enumerate(group):
            owner_path = f"{name}[{index}]"
            yield NodeEntry(f"{owner_path}.node", owner_path, owner, owner.node)


def resolve_topic(name: str, namespace: str, node_name: str) -> str:
    """Resolve a topic name as ROS 2 does: absolute, relative to the namespace, or private (``~``).

    Args:
        namespace: with a leading slash, "/" for the root.
    """
    base = namespace.rstrip("/")
    if name.startswith("/"):
        return name
    if name == "~" or name.startswith("~/"):
        return f"{base}/{node_name}{name[1:]}"
    return f"{base}/{name}"


def profile(block: pb.QoSSettings) -> QosProfile:
    """Convert a ``qos`` block into a profile with defaults."""
    return QosProfile(
        reliability="BEST_EFFORT" if block.reliability == pb.BEST_EFFORT else "RELIABLE",
        durability="TRANSIENT_LOCAL" if block.durability == pb.TRANSIENT_LOCAL else "VOLATILE",
        history="KEEP_ALL" if block.history == pb.KEEP_ALL else "KEEP_LAST",
        depth=block.depth or DEFAULT_DEPTH,
        liveliness="MANUAL_BY_TOPIC" if block.liveliness == pb.MANUAL_BY_TOPIC else "AUTOMATIC",
        deadline_s=block.deadline_s,
        lifespan_s=block.lifespan_s,
        lease_duration_s=block.lease_duration_s,
    )


def common_profile(one: QosProfile, other: QosProfile) -> QosProfile:
    """The strictest profile that two publishers both satisfy, as a subscription may request it.

    Source: the "best available" policies of the ROS 2 documentation, "Quality of Service settings".
    """
    if one == other:
        return one
    both_reliable = one.reliability == other.reliability == "RELIABLE"
    both_latched = one.durability == other.durability == "TRANSIENT_LOCAL"
    both_manual = one.liveliness == other.liveliness == "MANUAL_BY_TOPIC"
    return replace(
        one,
        reliability="RELIABLE" if both_reliable else "BEST_EFFORT",
        durability="TRANSIENT_LOCAL" if both_latched else "VOLATILE",
        depth=max(one.depth, other.depth),
        liveliness="MANUAL_BY_TOPIC" if both_manual else "AUTOMATIC",
        deadline_s=_longest(one.deadline_s, other.deadline_s),
        lease_duration_s=_longest(one.lease_duration_s, other.lease_duration_s),
    )


def _longest(one_s: float, other_s: float) -> float:
    """The longer of two durations; 0 means unlimited."""
    return max(one_s, other_s) if one_s > 0 and other_s > 0 else 0.0


def _endpoint(
    entry: NodeEntry,
    path: str,
    block: Any,
    *,
    is_publisher: bool,
    adopted: dict[str, QosProfile] | None = None,
) -> Endpoint:
    topic = resolve_topic(block.topic_name, entry.namespace, entry.node.node_name)
    if block.HasField("qos"):
        qos, qos_path = profile(block.qos), f"{path}.qos"
    elif entry.node.HasField("qos"):
        qos, qos_path = profile(entry.node.qos), f"{entry.path}.qos"
    else:
        qos, qos_path = (adopted or {}).get(topic, QosProfile()), ""
    is_named = bool(block.topic_name) and topic_fault(block.topic_name) is None
    return Endpoint(entry, path, block, is_publisher, topic, qos, qos_path, is_named)
