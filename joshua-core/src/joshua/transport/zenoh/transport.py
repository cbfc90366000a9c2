"""One process's connection to the ROS 2 graph over Zenoh."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from joshua.messages import dds_type_name, type_hash
from joshua.messages.typestore import shown_type_name
from joshua.plan import QosProfile, TransportSettings
from joshua.transport.delivery import Delivery
from joshua.transport.transports import (
    Emit,
    Endpoint,
    NodeHandle,
    NodeInfo,
    Publisher,
    Sample,
    Serve,
    ServiceInfo,
    Subscription,
    Transport,
    TransportError,
)
from joshua.transport.zenoh.graph import Graph
from joshua.transport.zenoh.keys import CLIENT, NODE, PUBLISHER, SERVICE, SUBSCRIPTION, Entity, data_key
from joshua.transport.zenoh.meeting import live_socket, unix_endpoint
from joshua.transport.zenoh.publisher import ZenohPublisher
from joshua.transport.zenoh.services import ZenohService, call
from joshua.transport.zenoh.settings import (
    client_config,
    close_session,
    node_config,
    open_session,
    own_router,
    require_certificates,
    waiting_config,
)
from joshua.transport.zenoh.subscription import ZenohSubscription
from joshua.transport.zenoh.watch import Watch

#: Pending requests of a busy service. Further ones displace the oldest.
_MOST_REQUESTS = 10
_NO_LINK = "Unable to connect"


class ZenohNode(NodeHandle):
    """One node of a session."""

    def __init__(self, home: ZenohTransport, entity: Entity) -> None:
        super().__init__(home, entity.name, entity.namespace)
        self.home, self._entity = home, entity
        self._requests: Delivery | None = None
        self._token: Any = home.session.liveliness().declare_token(entity.token)

    def publisher_node(self, publisher_gid: bytes) -> str:
        """Full name of the node that owns a publisher."""
        return self.home.graph.owner(publisher_gid)

    def _make_publisher(self, topic: str, type_name: str, qos: QosProfile, emit: Emit | None) -> Publisher:
        entity, key = self._endpoint(PUBLISHER, topic, type_name, qos)
        return ZenohPublisher(self, entity, key, qos, emit or _ignore)

    def _make_subscription(
        self,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Emit | None,
    ) -> Subscription:
        entity, key = self._endpoint(SUBSCRIPTION, topic, type_name, qos)
        return ZenohSubscription(self, entity, key, qos, callback, emit or _ignore)

    def _make_service(self, name: str, type_name: str, serve: Serve) -> Endpoint:
        if self._requests is None:
            self._requests = Delivery(f"joshua-services {self.name}", _MOST_REQUESTS, lambda take: take())
        entity, key = self._endpoint(SERVICE, name, type_name, QosProfile())
        return ZenohService(self, entity, key, serve, self._requests)

    def _call(self, name: str, type_name: str, request: bytes, timeout_s: float) -> bytes:
        entity, key = self._endpoint(CLIENT, name, type_name, QosProfile())
        return call(self.home.session, entity, key, request, timeout_s)

    def _leave(self) -> None:
        if self._requests is not None:
            self._requests.close()
        self._token.undeclare()

    def _endpoint(self, kind: str, topic: str, type_name: str, qos: QosProfile) -> tuple[Entity, str]:
        entity = replace(
            self._entity,
            entity_id=self.home.next_id(),
            kind=kind,
            topic=topic,
            type_name=dds_type_name(type_name),
            type_hash=type_hash(type_name),
            qos=qos,
        )
        return entity, data_key(entity.domain_id, topic, type_name)


class ZenohTransport(Transport):
    """A Zenoh session with the graph of its domain. Never open one before a fork."""

    carries_services = True

    def __init__(self, settings: TransportSettings) -> None:
        require_certificates(settings)
        self.session: Any = _open(settings)
        super().__init__(settings)
        self._ids = itertools.count()
        self.watch = Watch()
        self.graph = Graph(self.session, settings.domain_id, keep=self)

    def nodes(self) -> list[NodeInfo]:
        """The present graph."""
        return self.graph.nodes()

    def services(self) -> list[ServiceInfo]:
        """The services in the present graph, sorted by name."""
        found = {
            ServiceInfo(item.full_name, item.topic, shown_type_name(item.type_name))
            for item in self.graph.entities(SERVICE)
        }
        return sorted(found, key=lambda item: (item.name, item.node))

    @property
    def connected(self) -> bool:
        """Whether a router or another node is linked to this session."""
        return bool(self.session.info.transports())

    @property
    def meeting_point(self) -> str:
        """Address at which this session finds others, for messages."""
        return str(own_router(self.settings))

    def next_id(self) -> str:
        """An unused entity number of the session."""
        return str(next(self._ids))

    def _make_node(self, name: str, namespace: str) -> NodeHandle:
        self.graph.mark_session()
        number, zid = self.next_id(), str(self.session.zid())
        return ZenohNode(
            self, Entity(self.settings.domain_id, zid, number, number, NODE, "/", namespace, name)
        )

    def _leave(self) -> None:
        self.graph.close()
        self.watch.close()
        close_session(self.session)


def _open(settings: TransportSettings) -> Any:
    """Open a session: of a node in the folder of its run, or of another program at the router.

    Raises:
        TransportError: Zenoh refuses the settings.
    """
    try:
        if settings.link_folder or settings.discovery_range == "OFF":
            return open_session(node_config(settings), warn=False)
        path = live_socket(settings)
        endpoint = unix_endpoint(path) if path is not None else str(own_router(settings))
        try:
            return open_session(client_config(settings, endpoint), warn=False)
        except TransportError as error:
            if _NO_LINK not in str(error):
                raise
        return open_session(waiting_config(settings), warn=False)
    except TransportError as error:
        raise TransportError(f"the Zenoh session cannot be opened: {error}") from error


def _ignore(event: str, detail: str) -> None:
    """Drop an event without a listener."""
