"""One process's connection to the ROS 2 graph over Zenoh."""

from __future__ import annotations

import atexit
import itertools
import os
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import zenoh

from joshua.messages import dds_type_name, type_hash
from joshua.plan import QosProfile, TransportSpec
from joshua.transport.api import NodeHandle, NodeInfo, Publisher, Sample, Subscription, Transport
from joshua.transport.delivery import Delivery
from joshua.transport.errors import TransportError
from joshua.transport.names import require_node, require_topic
from joshua.transport.watch import Watch
from joshua.transport.zenoh.graph import Graph
from joshua.transport.zenoh.keys import ADMIN_SPACE, NODE, PUBLISHER, SUBSCRIPTION, Entity, data_key
from joshua.transport.zenoh.publisher import ZenohPublisher
from joshua.transport.zenoh.settings import close_session, open_session, own_router, session_config
from joshua.transport.zenoh.subscription import ZenohSubscription

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


class ZenohTransport(Transport):
    """A Zenoh session with the graph of its domain. Never open one before a fork."""

    def __init__(self, spec: TransportSpec) -> None:
        self.spec = spec
        self.graph = Graph()
        self.watch = Watch()
        self._ids = itertools.count()
        self._nodes: list[ZenohNode] = []
        self._lock = threading.Lock()
        self._closed = False
        self._process_id = os.getpid()
        try:
            self.session: Any = open_session(session_config(spec), warn=False)
        except TransportError as error:
            raise TransportError(f"the Zenoh session cannot be opened: {error}") from error
        self._zid = str(self.session.zid())
        self._events = Delivery("joshua-events", None, lambda event: event[0](*event[1:]))
        self._tokens: Any = self.session.liveliness().declare_subscriber(
            f"{ADMIN_SPACE}/{spec.domain_id}/**",
            zenoh.handlers.Callback(self._on_token, indirect=False),
            history=True,
        )
        # a session that is still open while the interpreter ends calls back into nothing
        atexit.register(self.close)

    def create_node(self, name: str, namespace: str = "/") -> NodeHandle:
        """Adds a node to the graph."""
        require_node(name, namespace)
        if self._closed:
            raise TransportError("the transport is closed")
        number = self.next_id()
        entity = Entity(self.spec.domain_id, self._zid, number, number, NODE, "/", namespace, name)
        node = ZenohNode(self, entity)
        self._nodes.append(node)
        return node

    def nodes(self) -> list[NodeInfo]:
        """The graph as known now."""
        return self.graph.nodes()

    @property
    def connected(self) -> bool:
        """Whether a router or another node is linked to this session."""
        return bool(self.session.info.transports())

    @property
    def meeting_point(self) -> str:
        """Where this session looks for others, for messages."""
        return str(own_router(self.spec))

    def close(self) -> None:
        """Closes everything."""
        with self._lock:
            if self._closed or os.getpid() != self._process_id:
                return  # a fork only inherited it
            self._closed = True
        atexit.unregister(self.close)
        for node in list(self._nodes):
            node.close()
        self._tokens.undeclare()
        self.watch.close()
        self._events.close()
        close_session(self.session)

    def next_id(self) -> str:
        """A number that no other entity of the session has."""
        return str(next(self._ids))

    def emitter(self, on_event: EventCallback | None) -> Callable[[str, str], None]:
        """A function that hands events to a callback on a thread where it may take its time."""
        if on_event is None:
            return lambda event, detail: None
        return lambda event, detail: self._events.push((on_event, event, detail))

    def forget(self, node: ZenohNode) -> None:
        """Drops a closed node."""
        if node in self._nodes:
            self._nodes.remove(node)

    def _on_token(self, sample: zenoh.Sample) -> None:
        self.graph.apply(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)
