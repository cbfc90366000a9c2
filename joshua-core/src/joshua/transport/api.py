"""The transport interface: ROS 2 nodes, endpoints and graph over serialised CDR payloads."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from joshua.plan import QosProfile, TransportSpec

Buffer = Any  # anything with the buffer protocol; typing.Buffer needs Python 3.12


@dataclass(frozen=True)
class Sample:
    """One received message.

    Attributes:
        cdr: serialised payload with its 4-byte encapsulation header.
        source_stamp_ns: the publisher's clock when it published, ns since the epoch; 0 if unknown.
        received_ns: this process's clock when the sample was taken from the receive queue, ns since the
            epoch; a slow callback takes it later than it came.
        sequence: the publisher's running number where the wire carries one, else 0.
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


class Publisher(ABC):
    """Sends serialised messages on one topic; thread-safe."""

    @abstractmethod
    def publish(self, cdr: Buffer) -> None:
        """Sends one serialised message; never blocks a control loop for longer than the hand-over."""

    @property
    @abstractmethod
    def subscription_count(self) -> int:
        """Matched subscriptions, in this process and in others."""

    @abstractmethod
    def assert_liveliness(self) -> None:
        """Says that this publisher is alive (MANUAL_BY_TOPIC)."""

    @abstractmethod
    def close(self) -> None:
        """Leaves the graph; a second call does nothing."""


class Subscription(ABC):
    """Receives serialised messages of one topic; the callback runs on a thread of the transport."""

    @property
    @abstractmethod
    def publisher_count(self) -> int:
        """Matched publishers, in this process and in others."""

    @abstractmethod
    def close(self) -> None:
        """Leaves the graph; after the return no callback runs any more. A second call does nothing."""


class NodeHandle(ABC):
    """A ROS 2 node in the graph; closing it closes its endpoints."""

    @abstractmethod
    def create_publisher(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        *,
        on_event: Callable[[str, str], None] | None = None,
    ) -> Publisher:
        """Declares a publisher.

        Args:
            topic: fully qualified name, such as ``/leader/joint_states``.
            type_name: ROS 2 type, such as ``sensor_msgs/msg/JointState``.
            qos: profile that is offered.
            on_event: called with (event, detail); events are ``deadline-missed``, ``liveliness-lost``,
                ``incompatible-qos``.

        Raises:
            TransportError: the topic name is invalid or the node is closed.
            MessageError: the type is unknown.
        """

    @abstractmethod
    def create_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        *,
        on_event: Callable[[str, str], None] | None = None,
    ) -> Subscription:
        """Declares a subscription.

        Args:
            topic: fully qualified name.
            type_name: ROS 2 type.
            qos: profile that is asked for; with KEEP_LAST its depth bounds the receive queue.
            callback: called with each sample, one at a time, on a thread of this subscription.
            on_event: as for publishers; a lost publisher is ``liveliness-lost``.

        Raises:
            TransportError: the topic name is invalid or the node is closed.
            MessageError: the type is unknown.
        """

    @abstractmethod
    def publisher_node(self, publisher_gid: bytes) -> str:
        """Full name of the node that owns a publisher anywhere in the graph; "" while it is not known.

        It searches the graph: ask once for each publisher, not for each message.
        """

    @abstractmethod
    def close(self) -> None:
        """Closes the endpoints and leaves the graph; a second call does nothing."""


class Transport(ABC):
    """One connection of this process to the ROS 2 graph.

    Open it with ``joshua.transport.open_transport(spec)``, once in a process, after any fork.
    """

    spec: TransportSpec

    @abstractmethod
    def create_node(self, name: str, namespace: str = "/") -> NodeHandle:
        """Adds a node to the graph."""

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether the meeting point of the transport is there: a router over Zenoh; always over DDS."""

    @property
    @abstractmethod
    def meeting_point(self) -> str:
        """Where this process looks for others, for messages."""

    @abstractmethod
    def nodes(self) -> list[NodeInfo]:
        """The graph as known now: every node of the domain, ours and ROS 2's, with its endpoints."""

    @abstractmethod
    def close(self) -> None:
        """Closes everything; a second call does nothing."""
