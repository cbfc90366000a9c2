"""The transport interface: ROS 2 nodes, endpoints and graph over serialised CDR payloads.

A transport derives from ``Transport``, ``NodeHandle``, ``Publisher`` and ``Subscription`` and implements
their abstract methods. Names, life cycle and the event thread are common to all. Plugins import these classes
from ``joshua.api``.
"""

from __future__ import annotations

import atexit
import os
import re
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

from joshua.messages.typestore import require_type
from joshua.plan import QosProfile as QosProfile
from joshua.plan import TransportSettings as TransportSettings
from joshua.transport.delivery import Delivery

Buffer = Any  # anything with the buffer protocol; typing.Buffer needs Python 3.12
Emit = Callable[[str, str], None]
"""Called with (event, detail); events are ``deadline-missed``, ``liveliness-lost``, ``incompatible-qos``."""

Serve = Callable[[bytes], "bytes | Future[bytes]"]
NAMELESS = "_CREATED_BY_BARE_DDS_APP_"
"""Name in ROS 2 for the node of endpoints that no node has announced."""

_TOPIC = re.compile(r"^(/[A-Za-z_][A-Za-z0-9_]*)+$")
_NODE = re.compile(r"^[A-Za-z_][A-Za-z0-9_]*$")


class TransportError(RuntimeError):
    """The transport cannot be opened or used. The message says why and what to do."""

    exit_code: ClassVar[int] = 1


@dataclass(frozen=True)
class Sample:
    """One received message.

    Attributes:
        cdr: serialised payload with its 4-byte encapsulation header.
        source_stamp_ns: the publisher's clock when it published, ns since the epoch; 0 if unknown.
        received_ns: this process's clock when the sample was taken from the receive queue, ns since the
            epoch; later than its arrival if the callback is slow.
        sequence: the publisher's sequence number if it is sent, else 0.
        publisher_gid: identity of the publisher, 16 bytes; empty if unknown.
    """

    cdr: Buffer
    source_stamp_ns: int
    received_ns: int
    sequence: int
    publisher_gid: bytes


@dataclass(frozen=True)
class EndpointInfo:
    """One publisher or subscription in the graph."""

    node_name: str
    node_namespace: str
    topic: str
    type_name: str
    type_hash: str
    is_publisher: bool
    qos: QosProfile


@dataclass(frozen=True)
class NodeInfo:
    """One node in the graph with its endpoints."""

    name: str
    namespace: str
    endpoints: Sequence[EndpointInfo] = field(default_factory=tuple)


@dataclass(frozen=True)
class ServiceInfo:
    """One service in the graph."""

    node: str
    name: str
    type_name: str


class Endpoint(ABC):
    """A publisher, subscription or service of a node; ``topic`` is its fully qualified name."""

    def __init__(self, node: NodeHandle, topic: str) -> None:
        self.topic = topic
        self._node = node
        self._lock = threading.Lock()
        self._closed = False

    def close(self) -> None:
        """Leave the graph. Idempotent. No callback of a subscription runs after the return."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self._node.forget(self)
        self._leave()

    @abstractmethod
    def _leave(self) -> None:
        """Release the middleware's resources of this endpoint. Called once."""


class Publisher(Endpoint):
    """Sends serialised messages on one topic. Thread-safe."""

    @abstractmethod
    def publish(self, cdr: Buffer) -> None:
        """Send one serialised message. Raises TransportError if closed or refused."""

    @property
    @abstractmethod
    def subscription_count(self) -> int:
        """Matched subscriptions, in this process and in others."""

    @abstractmethod
    def assert_liveliness(self) -> None:
        """Assert that this publisher is alive (MANUAL_BY_TOPIC)."""


class Subscription(Endpoint):
    """Receives serialised messages of one topic. The callback runs on a thread of the transport."""

    @property
    @abstractmethod
    def publisher_count(self) -> int:
        """Matched publishers, in this process and in others."""


EndpointT = TypeVar("EndpointT", bound=Endpoint)


class NodeHandle(ABC):
    """A ROS 2 node in the graph. Closing it closes its endpoints."""

    def __init__(self, transport: Transport, name: str, namespace: str) -> None:
        self.name, self.namespace = name, namespace
        self._transport = transport
        self._lock = threading.RLock()
        self._endpoints: list[Endpoint] = []
        self._closed = False

    def create_publisher(
        self, topic: str, type_name: str, qos: QosProfile, *, on_event: Emit | None = None
    ) -> Publisher:
        """Declare a publisher.

        Args:
            topic: fully qualified name, such as ``/leader/joint_states``.
            type_name: ROS 2 type, such as ``sensor_msgs/msg/JointState``.
            qos: offered profile.
            on_event: called with (event, detail) on a thread of the transport.

        Raises:
            TransportError: the topic name is invalid or the node is closed.
            MessageError: the type is unknown.
        """
        full, emit = require_type(type_name), self._transport.emitter(on_event)
        require_topic(topic)
        return self._add(lambda: self._make_publisher(topic, full, qos, emit))

    def create_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        *,
        on_event: Emit | None = None,
    ) -> Subscription:
        """Declare a subscription.

        Args:
            topic: fully qualified name.
            type_name: ROS 2 type.
            qos: requested profile. With KEEP_LAST, its depth bounds the receive queue.
            callback: called with each sample, one at a time, on a thread of this subscription.
            on_event: as for publishers; a lost publisher is ``liveliness-lost``.

        Raises:
            TransportError: the topic name is invalid or the node is closed.
            MessageError: the type is unknown.
        """
        full, emit = require_type(type_name), self._transport.emitter(on_event)
        require_topic(topic)
        return self._add(lambda: self._make_subscription(topic, full, qos, callback, emit))

    def create_service(self, name: str, type_name: str, serve: Serve) -> Endpoint:
        """Offer a service.

        Args:
            name: fully qualified name, such as ``/arm/stop``.
            type_name: ROS 2 type, such as ``std_srvs/srv/Trigger``.
            serve: called with each serialised request, one at a time, on a thread of the node. Returns the
                serialised response, or a future of it.

        Raises:
            TransportError: the name is invalid, the node is closed, or the transport has no services.
            MessageError: the type is unknown.
        """
        full = require_type(type_name)
        require_topic(name)
        return self._add(lambda: self._make_service(name, full, serve))

    def call_service(self, name: str, type_name: str, request: bytes, timeout_s: float) -> bytes:
        """Call a service and return its serialised response.

        Raises:
            TransportError: no response in time, the server refuses, or the transport has no services.
            MessageError: the type is unknown.
        """
        return self._call(require_topic(name), require_type(type_name), request, timeout_s)

    def close(self) -> None:
        """Close the endpoints and leave the graph. Idempotent."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        for endpoint in list(self._endpoints):
            endpoint.close()
        self._leave()
        self._transport.forget(self)

    def forget(self, endpoint: Endpoint) -> None:
        """Drop a closing endpoint."""
        with self._lock:
            self._endpoints.remove(endpoint)
            if not self._closed:
                self._endpoints_changed()

    @abstractmethod
    def publisher_node(self, publisher_gid: bytes) -> str:
        """Full name of the node of a publisher; "" if unknown. Searches the whole graph."""

    @abstractmethod
    def _make_publisher(self, topic: str, type_name: str, qos: QosProfile, emit: Emit | None) -> Publisher:
        """Declare a publisher of a valid topic and a known type."""

    @abstractmethod
    def _make_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Emit | None,
    ) -> Subscription:
        """Declare a subscription of a valid topic and a known type."""

    def _make_service(self, name: str, type_name: str, serve: Serve) -> Endpoint:
        """Offer a service of a valid name and a known type."""
        raise TransportError(f"the transport {self._transport.settings.kind} carries no services")

    def _call(self, name: str, type_name: str, request: bytes, timeout_s: float) -> bytes:
        """Call a service of a valid name and a known type."""
        raise TransportError(f"the transport {self._transport.settings.kind} carries no services")

    @abstractmethod
    def _leave(self) -> None:
        """Leave the graph. Called once, after the endpoints are closed."""

    def _endpoints_changed(self) -> None:
        """Announce the endpoints, if the node does that."""

    def _add(self, make: Callable[[], EndpointT]) -> EndpointT:
        with self._lock:
            if self._closed:
                raise TransportError(f"the node {self.name} is closed")
            made = make()
            self._endpoints.append(made)
            self._endpoints_changed()
        return made


class Transport(ABC):
    """One connection of this process to the ROS 2 graph.

    Open it with ``joshua.transport.open_transport(settings)``, once in a process, after any fork. A class
    that derives from it joins the graph before it calls this constructor.
    """

    #: Whether nodes can offer and call services.
    carries_services: ClassVar[bool] = False

    def __init__(self, settings: TransportSettings) -> None:
        self.settings = settings
        self._lock = threading.Lock()
        self._nodes: list[NodeHandle] = []
        self._closed = False
        self._process_id = os.getpid()
        self._events = Delivery("joshua-events", None, lambda event: event[0](*event[1:]))
        # an open connection at the end of the interpreter would call back into freed objects
        atexit.register(self.close)

    def create_node(self, name: str, namespace: str = "/") -> NodeHandle:
        """Add a node to the graph.

        Raises:
            TransportError: the name or namespace is invalid, or the transport is closed.
        """
        require_node(name, namespace)
        if self._closed:
            raise TransportError("the transport is closed")
        node = self._make_node(name, namespace)
        self._nodes.append(node)
        return node

    def close(self) -> None:
        """Close everything. Idempotent, and without effect in a fork."""
        with self._lock:
            if self._closed or os.getpid() != self._process_id:
                return
            self._closed = True
        atexit.unregister(self.close)
        for node in list(self._nodes):
            node.close()
        self._events.close()
        self._leave()

    def forget(self, node: NodeHandle) -> None:
        """Drop a closing node."""
        if node in self._nodes:
            self._nodes.remove(node)

    def emitter(self, on_event: Emit | None) -> Emit | None:
        """A function that passes events to a callback on a thread that may block."""
        if on_event is None:
            return None
        return lambda event, detail: self._events.push((on_event, event, detail))

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether the transport can find others: over Zenoh if a router responds; over DDS always."""

    @property
    @abstractmethod
    def meeting_point(self) -> str:
        """Address at which this process finds others, for messages."""

    @abstractmethod
    def nodes(self) -> list[NodeInfo]:
        """The present graph: every node of the domain, of JOSHUA and ROS 2, with its endpoints."""

    def services(self) -> list[ServiceInfo]:
        """The services in the present graph, sorted by name."""
        return []

    @abstractmethod
    def _make_node(self, name: str, namespace: str) -> NodeHandle:
        """Add a node with valid names."""

    @abstractmethod
    def _leave(self) -> None:
        """Leave the graph. Called once, after the nodes are closed."""


def require_topic(topic: str) -> str:
    """Check and return a fully qualified topic or service name.

    Source: ROS 2 design, "Topic and Service name mapping to DDS".

    Raises:
        TransportError: not a fully qualified ROS 2 name.
    """
    if not _TOPIC.match(topic) or "__" in topic:
        raise TransportError(
            f"{topic!r} is not a fully qualified topic name. Write a path such as /leader/joint_states. "
            "Each part follows a slash, has letters, digits and single underscores, and no leading digit"
        )
    return topic


def require_node(name: str, namespace: str) -> None:
    """Check node name and namespace.

    Raises:
        TransportError: not a ROS 2 node name, or not a namespace with a leading slash.
    """
    if not _NODE.match(name):
        raise TransportError(
            f"{name!r} is not a node name. Write letters, digits and underscores without a leading digit, "
            "such as leader_arm"
        )
    if namespace != "/" and (not _TOPIC.match(namespace) or "__" in namespace):
        raise TransportError(f"{namespace!r} is not a namespace. Write / or a path such as /left")
