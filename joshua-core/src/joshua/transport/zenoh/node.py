"""A ROS 2 node over Zenoh: a liveliness token and its endpoints."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from joshua.messages import dds_type_name, type_hash
from joshua.plan import QosProfile
from joshua.transport.api import NodeHandle, Publisher, Sample, Subscription
from joshua.transport.errors import TransportError
from joshua.transport.names import require_topic
from joshua.transport.zenoh.keys import PUBLISHER, SUBSCRIPTION, Entity, data_key
from joshua.transport.zenoh.publisher import ZenohPublisher
from joshua.transport.zenoh.subscription import ZenohSubscription

if TYPE_CHECKING:
    from joshua.transport.zenoh.transport import ZenohTransport

EventCallback = Callable[[str, str], None]


class ZenohNode(NodeHandle):
    """One node of a session."""

    def __init__(self, transport: ZenohTransport, entity: Entity) -> None:
        self._transport, self._entity = transport, entity
        self._endpoints: list[ZenohPublisher | ZenohSubscription] = []
        self._lock = threading.Lock()
        self._closed = False
        self._token: Any = transport.session.liveliness().declare_token(entity.token)

    def create_publisher(
        self, topic: str, type_name: str, qos: QosProfile, *, on_event: EventCallback | None = None
    ) -> Publisher:
        """Declares a publisher."""
        entity, key = self._endpoint(PUBLISHER, topic, type_name, qos)
        home = self._transport
        made = ZenohPublisher(home.session, home.graph, home.watch, entity, key, qos, home.emitter(on_event))
        self._endpoints.append(made)
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
        entity, key = self._endpoint(SUBSCRIPTION, topic, type_name, qos)
        home = self._transport
        made = ZenohSubscription(
            home.session, home.graph, home.watch, entity, key, qos, callback, home.emitter(on_event)
        )
        self._endpoints.append(made)
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
        for endpoint in self._endpoints:
            endpoint.close()
        self._token.undeclare()
        self._transport.forget(self)

    def _endpoint(self, kind: str, topic: str, type_name: str, qos: QosProfile) -> tuple[Entity, Any]:
        require_topic(topic)
        if self._closed:
            raise TransportError(f"the node {self._entity.name} is closed")
        entity = replace(
            self._entity,
            entity_id=self._transport.next_id(),
            kind=kind,
            topic=topic,
            type_name=dds_type_name(type_name),
            type_hash=type_hash(type_name),
            qos=qos,
        )
        return entity, data_key(entity.domain_id, topic, type_name)
