"""The robot described by a file: its nodes, their topics, commanders and services.

One graph is built after loading, includes, overrides and amendments. Checks, planner, `joshua plan` and
`joshua explain` read it. It references the blocks of the configuration and must not change them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

from joshua.plan.qos import QosProfile
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types

COMMAND_TYPES = (types.JOINT_STATE, types.JOINT_TRAJECTORY)

_Item = TypeVar("_Item")


@dataclass(frozen=True, eq=False, repr=False)
class NodeEntry:
    """One node block of a file.

    Attributes:
        path: field path of the ``node`` block, such as ``robot.actions[0].node``.
        owner_path: field path of its entry, such as ``robot.actions[0]``.
        owner: that entry: SingleAction, SinglePerception or SingleModel.
        node: the block itself.
    """

    path: str
    owner_path: str
    owner: Any
    node: pb.Node

    @property
    def namespace(self) -> str:
        """Namespace with a leading slash and no trailing slash; "/" for the root."""
        return "/" + self.node.ros_namespace.strip("/")

    @property
    def full_name(self) -> str:
        """Fully qualified node name."""
        return f"{self.namespace.rstrip('/')}/{self.node.node_name}"

    @property
    def is_actuator(self) -> bool:
        """Whether the node drives an actuator."""
        return isinstance(self.owner, pb.SingleAction)

    @property
    def applied_command_topic(self) -> str:
        """Topic on which an actuator publishes its written goals, after ramp and limits."""
        return f"{self.full_name}/applied_command"

    @property
    def is_sensor(self) -> bool:
        """Whether the node reads a sensor or an input device."""
        return isinstance(self.owner, pb.SinglePerception)

    @property
    def is_model(self) -> bool:
        """Whether the node runs a model."""
        return isinstance(self.owner, pb.SingleModel)

    @property
    def leads(self) -> bool:
        """Whether the node is a leader arm, which a person moves."""
        return self.is_actuator and bool(self.owner.action_type == pb.ACTION_LEADER)


@dataclass(frozen=True, eq=False, repr=False)
class Endpoint:
    """One publisher or subscription of a node block.

    Attributes:
        entry: its node block.
        path: field path, such as ``robot.actions[0].node.publishers[0]``.
        block: the Publisher or Subscription message.
        is_publisher: whether it is a publisher.
        topic: fully qualified topic name.
        qos: the effective profile. A subscription without one gets what its publishers have in common.
        qos_path: field path of the block that set the profile; "" for none.
        is_named: the topic name is valid in ROS 2.
    """

    entry: NodeEntry
    path: str
    block: Any
    is_publisher: bool
    topic: str
    qos: QosProfile
    qos_path: str
    is_named: bool = True

    @property
    def is_command(self) -> bool:
        """Whether this subscription receives commands of an actuator."""
        return not self.is_publisher and self.entry.is_actuator and self.block.data_type in COMMAND_TYPES


@dataclass(frozen=True, eq=False, repr=False)
class ServiceTopic:
    """A topic that a service publishes or subscribes to.

    Attributes:
        name: fully qualified, or relative to the node as in ``~/progress``; type_name: ROS 2 type.
        rate_hz: of a publisher; 0 for none.
        qos: None for the default; for a subscription, what the topic's publishers have in common.
    """

    name: str
    type_name: str
    is_publisher: bool = False
    rate_hz: float = 0.0
    qos: QosProfile | None = None


@dataclass(frozen=True, eq=False, repr=False)
class GraphService:
    """A service that the mode runs beside the devices: its name, the block that requests it, its topics."""

    name: str
    path: str
    topics: tuple[ServiceTopic, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class RobotGraph:
    """The nodes, endpoints and services of one configuration.

    Attributes:
        entries: every node block of actions, perceptions and models, in the order of the file.
        endpoints: their publishers, then their subscriptions.
        services: of the file's mode; () if the mode is unknown.
        replays: a recording commands the actuators.
    """

    entries: tuple[NodeEntry, ...]
    endpoints: tuple[Endpoint, ...]
    services: tuple[GraphService, ...] = ()
    replays: bool = False

    def with_services(self, services: Iterable[GraphService]) -> RobotGraph:
        """The same graph with the services of a mode."""
        return replace(self, services=tuple(services))

    @cached_property
    def actuators(self) -> tuple[NodeEntry, ...]:
        """The actuators of the file."""
        return tuple(entry for entry in self.entries if entry.is_actuator)

    @cached_property
    def models(self) -> tuple[NodeEntry, ...]:
        """The models of the file."""
        return tuple(entry for entry in self.entries if entry.is_model)

    @cached_property
    def by_path(self) -> dict[str, Endpoint]:
        """Every endpoint by its field path."""
        return {item.path: item for item in self.endpoints}

    @cached_property
    def usable(self) -> tuple[Endpoint, ...]:
        """The endpoints whose topic name is valid; the others are reported by the naming rules."""
        return tuple(item for item in self.endpoints if item.is_named)

    def pictures(self, camera: str = "") -> list[Endpoint]:
        """The publishers of pictures, of the node ``camera`` alone; "" for all."""
        kinds = (types.IMAGE, types.COMPRESSED_IMAGE)
        found = (item for item in self.usable if item.is_publisher and item.block.data_type in kinds)
        return [item for item in found if camera in ("", item.entry.node.node_name, item.topic)]

    @cached_property
    def by_topic(self) -> dict[str, list[Endpoint]]:
        """The usable endpoints of each topic."""
        return _grouped((item.topic, item) for item in self.usable)

    @cached_property
    def _by_entry(self) -> dict[str, list[Endpoint]]:
        return _grouped((item.entry.path, item) for item in self.usable)

    def of_entry(self, entry: NodeEntry) -> list[Endpoint]:
        """The usable endpoints of a node."""
        return self._by_entry.get(entry.path, [])

    def commands(self, entry: NodeEntry) -> list[Endpoint]:
        """Subscriptions that receive commands of actuators."""
        return [item for item in self.of_entry(entry) if item.is_command]

    def is_external(self, entry: NodeEntry) -> bool:
        """Whether nodes outside the file may command an actuator."""
        return any(item.block.external for item in self.commands(entry))

    @cached_property
    def command_sources(self) -> dict[str, list[Endpoint]]:
        """Publishers that can command an actuator, by topic."""
        return _grouped(
            (item.topic, item)
            for item in self.usable
            if item.is_publisher and item.block.data_type in COMMAND_TYPES
        )

    @cached_property
    def published_by_nodes(self) -> dict[str, int]:
        """Topics that the nodes of the file publish, and their types."""
        return {item.topic: item.block.data_type for item in self.usable if item.is_publisher}

    @cached_property
    def published(self) -> dict[str, int]:
        """Topics that the run publishes, and their types.

        Includes those of its nodes, the automatic ones of actuators, and the commands of a replay.
        """
        names = dict(self.published_by_nodes)
        for entry in self.actuators:
            if entry.node.node_name:
                names.setdefault(entry.applied_command_topic, types.JOINT_STATE)
                if topic := self.intervention_topic(entry):
                    names.setdefault(topic, types.BOOL)
        if self.replays:
            names |= {item.topic: item.block.data_type for item in self.usable if item.is_command}
        return names

    @cached_property
    def all_published(self) -> bool:
        """Whether the topics of all publishers are known. If not, no topic counts as unpublished."""
        return all(item.is_named for item in self.endpoints if item.is_publisher)

    def commanders(self, entry: NodeEntry) -> list[Endpoint]:
        """The publishers of other nodes on the topics that a node subscribes to, in the order of the file."""
        topics = {item.topic for item in self.all_of_entry(entry) if not item.is_publisher}
        publishers = (item for item in self._on(topics) if item.is_publisher)
        return [item for item in publishers if item.entry.path != entry.path]

    def intervention_topic(self, entry: NodeEntry) -> str:
        """Topic that reports whether a person has taken over from a model; "" if no person can."""
        sources = self.commanders(entry) if entry.is_actuator else []
        can = any(item.block.override for item in sources) and any(item.entry.is_model for item in sources)
        return f"{entry.full_name}/intervention" if can else ""

    def driven_by(self, entry: NodeEntry) -> list[NodeEntry]:
        """The actuators that subscribe to a node's topics, once for each subscription."""
        topics = {item.topic for item in self.all_of_entry(entry) if item.is_publisher}
        readers = (item for item in self._on(topics) if not item.is_publisher)
        return [item.entry for item in readers if item.entry.is_actuator]

    def all_of_entry(self, entry: NodeEntry) -> list[Endpoint]:
        """All endpoints of a node, those with an invalid topic name, too."""
        return self._all_by_entry.get(entry.path, [])

    def _on(self, topics: Iterable[str]) -> list[Endpoint]:
        """All endpoints on some topics, in the order of the file."""
        found = [item for topic in topics for item in self._all_by_topic.get(topic, [])]
        return sorted(found, key=lambda item: self._places[item.path])

    @cached_property
    def _all_by_entry(self) -> dict[str, list[Endpoint]]:
        return _grouped((item.entry.path, item) for item in self.endpoints)

    @cached_property
    def _all_by_topic(self) -> dict[str, list[Endpoint]]:
        return _grouped((item.topic, item) for item in self.endpoints)

    @cached_property
    def _places(self) -> dict[str, int]:
        """The place of each endpoint in the file, by its field path."""
        return {item.path: place for place, item in enumerate(self.endpoints)}


def _grouped(items: Iterable[tuple[str, _Item]]) -> dict[str, list[_Item]]:
    groups: dict[str, list[_Item]] = {}
    for key, item in items:
        groups.setdefault(key, []).append(item)
    return groups
