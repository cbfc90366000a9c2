"""One process's connection to the ROS 2 graph over DDS."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.topic import Topic
from joshua.api.transports import (
    Emit,
    NodeHandle,
    NodeInfo,
    Publisher,
    QosProfile,
    Sample,
    Subscription,
    Transport,
    TransportError,
    TransportSettings,
)

from joshua_dds import raw
from joshua_dds.config import domain_config, require_usable, sockets_on_loopback, stays_local
from joshua_dds.discovery_info import NodeEntry
from joshua_dds.events import Events, EventSource
from joshua_dds.graph import Graph
from joshua_dds.publisher import DdsPublisher
from joshua_dds.subscription import DdsSubscription
from joshua_dds.types import idl_type


class DdsNode(NodeHandle):
    """One node of the participant."""

    def __init__(self, home: DdsTransport, name: str, namespace: str) -> None:
        super().__init__(home, name, namespace)
        self.home = home
        self._endpoints_changed()

    def publisher_node(self, publisher_gid: bytes) -> str:
        """Return the full name of the node that owns a publisher."""
        return self.home.graph.owner(publisher_gid)

    def _make_publisher(self, topic: str, type_name: str, qos: QosProfile, emit: Emit | None) -> Publisher:
        return DdsPublisher(self, topic, type_name, qos, emit)

    def _make_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Emit | None,
    ) -> Subscription:
        return DdsSubscription(self, topic, type_name, qos, callback, emit)

    def _endpoints_changed(self) -> None:
        readers = tuple(item.gid for item in self._endpoints if isinstance(item, DdsSubscription))
        writers = tuple(item.gid for item in self._endpoints if isinstance(item, DdsPublisher))
        self.home.graph.announce(id(self), NodeEntry(self.namespace, self.name, readers, writers))

    def _leave(self) -> None:
        self.home.graph.announce(id(self), None)


class DdsTransport(Transport):
    """A participant of a DDS domain with the graph of its nodes."""

    def __init__(self, settings: TransportSettings) -> None:
        require_usable(settings)
        _enter_domain(settings)
        try:
            self.participant: Any = DomainParticipant(
                settings.domain_id, qos=Qos(Policy.Userdata(b"enclave=/;"))
            )
        except DDSException as error:
            _leave_domain(settings)
            raise TransportError(
                f"DDS cannot join domain {settings.domain_id}: {error} If many processes share the domain, "
                "stop some or choose another ROS_DOMAIN_ID. Otherwise check network_interface"
            ) from error
        super().__init__(settings)
        self._topics: dict[tuple[str, str], Any] = {}
        self._topics_lock = threading.Lock()
        self.graph = Graph(self.participant)
        self.events = Events(self.participant)

    def nodes(self) -> list[NodeInfo]:
        """Return the graph as known at present."""
        return self.graph.nodes()

    @property
    def connected(self) -> bool:
        """Whether DDS runs; DDS has no meeting point that could be missing."""
        return not self._closed

    @property
    def meeting_point(self) -> str:
        """Where this participant looks for others, as text for messages."""
        return f"DDS domain {self.settings.domain_id}"

    def topic(self, name: str, type_name: str) -> Any:
        """Return the DDS topic of a ROS 2 topic, made once for each pair of name and type."""
        with self._topics_lock:
            key = (name, type_name)
            if key not in self._topics:
                try:
                    self._topics[key] = Topic(self.participant, f"rt{name}", idl_type(type_name))
                except DDSException as error:
                    raise TransportError(
                        f"the topic {name} of {type_name} cannot be created: {error}"
                    ) from error
            return self._topics[key]

    def watch(
        self,
        entity: Any,
        topic: str,
        qos: QosProfile,
        is_writer: bool,
        emit: Emit | None,
    ) -> None:
        """Report the events of an endpoint if its owner requested them."""
        if emit is not None:
            self.events.add(EventSource(entity, topic, qos, is_writer, emit))

    def _make_node(self, name: str, namespace: str) -> NodeHandle:
        return DdsNode(self, name, namespace)

    def _leave(self) -> None:
        self.events.close()
        self.graph.close()
        for topic in self._topics.values():
            raw.delete(topic)
        raw.delete(self.participant)
        _leave_domain(self.settings)


_domains: dict[int, tuple[str, Any, int]] = {}
_domains_lock = threading.Lock()


def _enter_domain(settings: TransportSettings) -> None:
    """Configure the domain; a process has one configuration for each domain."""
    config = domain_config(settings)
    with _domains_lock:
        present = _domains.get(settings.domain_id)
        if present is not None and present[0] != config:
            raise TransportError(
                f"this process has joined DDS domain {settings.domain_id} with other settings. Close that "
                "transport first"
            )
        if present is None:
            try:
                with sockets_on_loopback(stays_local(settings)):
                    domain = Domain(settings.domain_id, config)
            except DDSException as error:
                raise TransportError(
                    f"DDS refuses the settings of domain {settings.domain_id}, which the lines above name. "
                    "Check CYCLONEDDS_URI, network_interface and peers"
                ) from error
            present = (config, domain, 0)
        _domains[settings.domain_id] = (present[0], present[1], present[2] + 1)


def _leave_domain(settings: TransportSettings) -> None:
    with _domains_lock:
        config, domain, users = _domains[settings.domain_id]
        if users > 1:
            _domains[settings.domain_id] = (config, domain, users - 1)
            return
        del _domains[settings.domain_id]
        raw.delete(domain)
