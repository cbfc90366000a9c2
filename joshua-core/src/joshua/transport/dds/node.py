"""A ROS 2 node over DDS: its endpoints, announced as its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from joshua.messages.typestore import require_type
from joshua.plan import QosProfile
from joshua.transport.api import NodeHandle, Publisher, Sample, Subscription
from joshua.transport.dds.discovery_info import NodeEntry
from joshua.transport.dds.events import EventSource
from joshua.transport.dds.publisher import DdsPublisher
from joshua.transport.dds.subscription import DdsSubscription
from joshua.transport.errors import TransportError
from joshua.transport.names import require_topic

if TYPE_CHECKING:
    from joshua.transport.dds.transport import DdsTransport

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
