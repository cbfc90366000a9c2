"""One process's connection to the ROS 2 graph over DDS."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from typing import Any

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.topic import Topic

from joshua.messages.typestore import require_type
from joshua.plan import QosProfile, TransportSpec
from joshua.transport.api import NodeHandle, NodeInfo, Publisher, Sample, Subscription, Transport
from joshua.transport.dds import raw
from joshua.transport.dds.config import domain_config, sockets_on_loopback, stays_local
from joshua.transport.dds.discovery_info import NodeEntry
from joshua.transport.dds.events import Events, EventSource
from joshua.transport.dds.graph import Graph
from joshua.transport.dds.publisher import DdsPublisher
from joshua.transport.dds.subscription import DdsSubscription
from joshua.transport.dds.types import idl_type
from joshua.transport.delivery import Delivery
from joshua.transport.errors import TransportError
from joshua.transport.names import require_node, require_topic

EventCallback = Callable[[str, str], None]


class DdsNode(NodeHandle):
    """One node of the participant."""

    def __init__(self, transport: DdsTransport, name: str, namespace: str) -> None:
        self._transport, self._name, self._namespace = transport, name, namespace
        self._lock = threading.RLock()
        self._publishers: list[DdsPublisher] = []
        self._subscriptions: list[DdsSubscription] = []
        self._closed = False
        self._announce()

    def create_publisher(
        self, topic: str, type_name: str, qos: QosProfile, *, on_event: EventCallback | None = None
    ) -> Publisher:
        """Declares a publisher."""
        full = self._require(topic, type_name)
        home = self._transport
        with self._lock:
            made = DdsPublisher(
                home.participant, home.topic(topic, full), topic, full, qos, self._forget_publisher
            )
            self._publishers.append(made)
            if on_event is not None:
                home.events.add(EventSource(made.entity, topic, qos, True, home.emitter(on_event)))
            self._announce()
        return made

    def create_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        *,
        on_event: EventCallback | None = None,
    ) -> Subscription:
        """Declares a subscription."""
        full = self._require(topic, type_name)
        home = self._transport
        with self._lock:
            made = DdsSubscription(
                home.participant,
                home.topic(topic, full),
                topic,
                full,
                qos,
                callback,
                self._forget_subscription,
            )
            self._subscriptions.append(made)
            if on_event is not None:
                home.events.add(EventSource(made.entity, topic, qos, False, home.emitter(on_event)))
            self._announce()
        return made

    def publisher_node(self, publisher_gid: bytes) -> str:
        """Full name of the node that owns a publisher."""
        return self._transport.graph.owner(publisher_gid)

    def close(self) -> None:
        """Closes the endpoints and leaves the graph."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        for publisher in list(self._publishers):
            publisher.close()
        for subscription in list(self._subscriptions):
            subscription.close()
        self._transport.graph.announce(id(self), None)
        self._transport.forget(self)

    def _require(self, topic: str, type_name: str) -> str:
        require_topic(topic)
        if self._closed:
            raise TransportError(f"the node {self._name} is closed")
        return require_type(type_name)

    def _forget_publisher(self, publisher: DdsPublisher) -> None:
        self._transport.events.remove(publisher.entity)
        with self._lock:
            self._publishers.remove(publisher)
            if not self._closed:
                self._announce()

    def _forget_subscription(self, subscription: DdsSubscription) -> None:
        self._transport.events.remove(subscription.entity)
        with self._lock:
            self._subscriptions.remove(subscription)
            if not self._closed:
                self._announce()

    def _announce(self) -> None:
        entry = NodeEntry(
            self._namespace,
            self._name,
            tuple(subscription.gid for subscription in self._subscriptions),
            tuple(publisher.gid for publisher in self._publishers),
        )
        self._transport.graph.announce(id(self), entry)


_domains: dict[int, tuple[str, Any, int]] = {}
_domains_lock = threading.Lock()


class DdsTransport(Transport):
    """A participant of a DDS domain with the graph of its nodes."""

    def __init__(self, spec: TransportSpec) -> None:
        self.spec = spec
        self._lock = threading.Lock()
        self._nodes: list[DdsNode] = []
        self._topics: dict[tuple[str, str], Any] = {}
        self._closed = False
        _enter_domain(spec)
        try:
            self.participant: Any = DomainParticipant(spec.domain_id, qos=Qos(Policy.Userdata(b"enclave=/;")))
        except DDSException as error:
            _leave_domain(spec)
            raise TransportError(
                f"DDS cannot join domain {spec.domain_id}: {error} Where many processes share the domain, "
                "stop some or choose another ROS_DOMAIN_ID; else check network_interface"
            ) from error
        self.graph = Graph(self.participant)
        self.events = Events(self.participant)
        self._deliveries = Delivery("joshua-events", None, lambda event: event[0](*event[1:]))
        atexit.register(self.close)

    def create_node(self, name: str, namespace: str = "/") -> NodeHandle:
        """Adds a node to the graph."""
        require_node(name, namespace)
        if self._closed:
            raise TransportError("the transport is closed")
        node = DdsNode(self, name, namespace)
        self._nodes.append(node)
        return node

    def nodes(self) -> list[NodeInfo]:
        """The graph as known now."""
        return self.graph.nodes()

    @property
    def connected(self) -> bool:
        """Whether DDS runs; there is no meeting point that could be missing."""
        return not self._closed

    @property
    def meeting_point(self) -> str:
        """Where this participant looks for others, for messages."""
        return f"DDS domain {self.spec.domain_id}"

    def close(self) -> None:
        """Closes everything."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        atexit.unregister(self.close)
        for node in list(self._nodes):
            node.close()
        self.events.close()
        self._deliveries.close()
        self.graph.close()
        for topic in self._topics.values():
            raw.delete(topic)
        raw.delete(self.participant)
        _leave_domain(self.spec)

    def topic(self, name: str, type_name: str) -> Any:
        """The DDS topic of a ROS 2 topic; made once for each pair of name and type."""
        with self._lock:
            key = (name, type_name)
            if key not in self._topics:
                try:
                    self._topics[key] = Topic(self.participant, f"rt{name}", idl_type(type_name))
                except DDSException as error:
                    raise TransportError(
                        f"the topic {name} of {type_name} cannot be made: {error}"
                    ) from error
            return self._topics[key]

    def emitter(self, on_event: EventCallback) -> Callable[[str, str], None]:
        """A function that hands events to a callback on a thread where it may take its time."""
        return lambda event, detail: self._deliveries.push((on_event, event, detail))

    def forget(self, node: DdsNode) -> None:
        """Drops a closed node."""
        if node in self._nodes:
            self._nodes.remove(node)


def _enter_domain(spec: TransportSpec) -> None:
    """Configures the domain; a process has one configuration for each domain."""
    config = domain_config(spec)
    with _domains_lock:
        present = _domains.get(spec.domain_id)
        if present is not None and present[0] != config:
            raise TransportError(
                f"this process has joined DDS domain {spec.domain_id} with other settings; close that first"
            )
        if present is None:
            try:
                with sockets_on_loopback(stays_local(spec)):
                    domain = Domain(spec.domain_id, config)
            except DDSException as error:
                raise TransportError(
                    f"DDS refuses the settings of domain {spec.domain_id} (the lines above say which): check "
                    "CYCLONEDDS_URI, network_interface and peers"
                ) from error
            present = (config, domain, 0)
        _domains[spec.domain_id] = (present[0], present[1], present[2] + 1)


def _leave_domain(spec: TransportSpec) -> None:
    with _domains_lock:
        config, domain, users = _domains[spec.domain_id]
        if users > 1:
            _domains[spec.domain_id] = (config, domain, users - 1)
            return
        del _domains[spec.domain_id]
        raw.delete(domain)
