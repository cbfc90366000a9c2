"""The ROS 2 graph from the liveliness tokens of a domain, and conventions between JOSHUA's nodes.

rmw_zenoh has no manual liveliness, and it connects every publisher with every subscription whatever their
QoS. JOSHUA's nodes add two conventions. The token ``@joshua_node/<domain>/<session>`` marks a session of
JOSHUA: QoS separates its endpoints as in DDS. A publisher with MANUAL_BY_TOPIC marks itself with the token
``@joshua_alive/<domain>/<gid>`` and puts an empty message on that key to assert that it is alive.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from joshua.messages.typestore import shown_type_name
from joshua.plan.qos import qos_clashes
from joshua.transport.transports import EndpointInfo, NodeInfo
from joshua.transport.zenoh.keys import ADMIN_SPACE, PUBLISHER, SUBSCRIPTION, Entity, read_token

_log = logging.getLogger("joshua.transport")
_NS_PER_S = 1_000_000_000
_SESSIONS, _ALIVE = "@joshua_node", "@joshua_alive"
Listener = Callable[[Entity, bool], None]


class Graph:
    """All entities of a domain. Notifies listeners of a topic when endpoints appear and disappear.

    Args:
        session: Zenoh session; domain_id: ROS 2 domain.
        keep: referenced while the session is open, because a fork that drops objects of Zenoh hangs.
    """

    def __init__(self, session: zenoh.Session, domain_id: int, keep: object = None) -> None:
        self._keep = keep
        self._lock = threading.Lock()
        # held while listeners run, which keeps the changes of an entity in order
        self._telling = threading.RLock()
        self._entities: dict[str, Entity] = {}
        self._listeners: dict[str, list[Listener]] = {}
        self._ours = {str(session.zid())}
        self._mark = f"{_SESSIONS}/{domain_id}/{session.zid()}"
        self._liveliness = session.liveliness()
        self._marked = False
        self._tokens: list[Any] = [
            self._liveliness.declare_subscriber(
                f"{space}/{domain_id}/{rest}",
                _direct(lambda sample, take=take: take(str(sample.key_expr), _present(sample))),  # type: ignore[misc]
                history=True,
            )
            for space, rest, take in (
                (_SESSIONS, "*", self._session_changed),
                (ADMIN_SPACE, "**", self.apply),
            )
        ]

    def close(self) -> None:
        """Stop following the domain."""
        for token in self._tokens:
            token.undeclare()

    def mark_session(self) -> None:
        """Declare that the endpoints of this session belong to JOSHUA. Idempotent."""
        if not self._marked:
            self._marked = True
            self._tokens.append(self._liveliness.declare_token(self._mark))

    def apply(self, token: str, present: bool) -> None:
        """Apply the appearance or disappearance of a liveliness token. Idempotent."""
        try:
            entity = read_token(token)
        except ValueError as error:
            _log.debug("ignored a liveliness token: %s", error)
            return
        with self._telling:
            with self._lock:
                if (token in self._entities) == present:
                    return
                if present:
                    self._entities[token] = entity
                else:
                    del self._entities[token]
            self._tell(entity, present)

    def listen(self, topic: str, listener: Listener) -> None:
        """Call ``listener(entity, present)`` for the endpoints of a topic, including the known ones."""
        with self._telling:
            with self._lock:
                self._listeners.setdefault(topic, []).append(listener)
                known = [entity for entity in self._entities.values() if entity.topic == topic]
            for entity in known:
                listener(entity, True)

    def ignore(self, topic: str, listener: Listener) -> None:
        """Stop calling a listener."""
        with self._lock:
            listeners = self._listeners.get(topic, [])
            if listener in listeners:
                listeners.remove(listener)

    def is_ours(self, entity: Entity) -> bool:
        """Whether an entity belongs to JOSHUA, whose nodes apply QoS where rmw_zenoh does not."""
        return entity.zid in self._ours

    def owner(self, publisher_gid: bytes) -> str:
        """Full name of the node of a publisher; "" if no token names it."""
        with self._lock:
            publishers = [entity for entity in self._entities.values() if entity.kind == PUBLISHER]
        return next((entity.full_name for entity in publishers if entity.gid == publisher_gid), "")

    def entities(self, kind: str) -> list[Entity]:
        """The entities of a kind."""
        with self._lock:
            return [entity for entity in self._entities.values() if entity.kind == kind]

    def nodes(self) -> list[NodeInfo]:
        """All nodes with their publishers and subscriptions, sorted by name."""
        with self._lock:
            entities = list(self._entities.values())
        names: dict[tuple[str, str], tuple[str, str]] = {}
        endpoints: dict[tuple[str, str], list[EndpointInfo]] = {}
        for entity in entities:
            key = (entity.zid, entity.node_id)
            names[key] = (entity.namespace, entity.name)
            if entity.kind in (PUBLISHER, SUBSCRIPTION) and entity.qos is not None:
                endpoints.setdefault(key, []).append(
                    EndpointInfo(
                        node_name=entity.name,
                        node_namespace=entity.namespace,
                        topic=entity.topic,
                        type_name=shown_type_name(entity.type_name),
                        type_hash=entity.type_hash,
                        is_publisher=entity.kind == PUBLISHER,
                        qos=entity.qos,
                    )
                )
        found = [
            NodeInfo(name=name, namespace=namespace, endpoints=tuple(endpoints.get(key, ())))
            for key, (namespace, name) in names.items()
        ]
        return sorted(found, key=lambda node: (node.namespace, node.name))

    def _tell(self, entity: Entity, present: bool) -> None:
        with self._lock:
            listeners = list(self._listeners.get(entity.topic, ()))
        for listener in listeners:
            listener(entity, present)

    def _session_changed(self, key: str, present: bool) -> None:
        """Notify listeners of a session's endpoints again, because their tokens may precede the session's."""
        zid = key.rsplit("/", 1)[1]
        with self._telling:
            with self._lock:
                if (zid in self._ours) == present:
                    return
                if not present:
                    self._ours.discard(zid)
                    return
                self._ours.add(zid)
                known = [entity for entity in self._entities.values() if entity.zid == zid]
            for entity in known:
                self._tell(entity, True)


class Matching:
    """Separates the compatible counterparts of an endpoint from those with incompatible QoS.

    The middleware connects every pair. Here, both sides detect a pair that must not connect.

    Args:
        graph: source of the counterparts; own: the endpoint.
        on_incompatible: called with a text for each pair that does not connect.
        on_lost: called when a connected counterpart leaves.
    """

    def __init__(
        self,
        graph: Graph,
        own: Entity,
        on_incompatible: Callable[[str], None],
        on_lost: Callable[[Entity], None] | None = None,
    ) -> None:
        self._graph, self._own = graph, own
        self._kind = SUBSCRIPTION if own.kind == PUBLISHER else PUBLISHER
        self._on_incompatible, self._on_lost = on_incompatible, on_lost
        self._lock = threading.Lock()
        self.connected: dict[bytes, Entity] = {}
        self.refused: frozenset[bytes] = frozenset()
        self.lifespans_ns: dict[bytes, float] = {}

    def graph_changed(self, entity: Entity, present: bool) -> None:
        """Apply a change of an endpoint of the topic."""
        own = self._own
        same_type = (entity.type_name, entity.type_hash) == (own.type_name, own.type_hash)
        if entity.kind != self._kind or not same_type or entity.qos is None or own.qos is None:
            return
        gid = entity.gid
        pair = (own.qos, entity.qos) if self._kind == SUBSCRIPTION else (entity.qos, own.qos)
        reasons = qos_clashes(*pair) if self._graph.is_ours(entity) else []
        # the sets are replaced, never changed, so that the receive path reads them without the lock
        with self._lock:
            lost = gid in self.connected and not present
            others = {key: value for key, value in self.connected.items() if key != gid}
            self.connected = {**others, gid: entity} if present and not reasons else others
            self.refused = self.refused | {gid} if present and reasons else self.refused - {gid}
            self.lifespans_ns = {
                key: other.qos.lifespan_s * _NS_PER_S
                for key, other in self.connected.items()
                if other.qos is not None and other.qos.lifespan_s > 0
            }
        if reasons and present:
            side = "subscription" if self._kind == SUBSCRIPTION else "publisher"
            why = "; ".join(
                f"{field}: the publisher offers {offered}, the subscription requests {requested}"
                for field, offered, requested in reasons
            )
            self._on_incompatible(f"the {side} of {entity.full_name} on {own.topic} does not connect: {why}")
        if lost and self._on_lost is not None:
            self._on_lost(entity)


class Assertions:
    """Manual liveliness, the publisher's side."""

    def __init__(self, session: zenoh.Session, domain_id: int, gid: bytes) -> None:
        key = f"{_ALIVE}/{domain_id}/{gid.hex()}"
        self._publisher: Any = session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.BLOCK
        )
        self._token: Any = session.liveliness().declare_token(key)

    def send(self) -> None:
        """Assert that the publisher is alive."""
        self._publisher.put(b"")

    def close(self) -> None:
        """Withdraw the mark."""
        self._token.undeclare()
        self._publisher.undeclare()


class AssertionListener:
    """Manual liveliness, the subscription's side.

    Args:
        marked: called with the gid of a publisher with manual assertion.
        asserted: called with the gid of each assertion.
    """

    def __init__(
        self,
        session: zenoh.Session,
        domain_id: int,
        marked: Callable[[bytes], None],
        asserted: Callable[[bytes], None],
    ) -> None:
        key = f"{_ALIVE}/{domain_id}/*"
        self._subscriber: Any = session.declare_subscriber(
            key, _direct(lambda sample: asserted(_gid(sample)))
        )
        self._tokens: Any = session.liveliness().declare_subscriber(
            key,
            _direct(lambda sample: marked(_gid(sample)) if _present(sample) else None),
            history=True,
        )

    def close(self) -> None:
        """Stop listening."""
        self._tokens.undeclare()
        self._subscriber.undeclare()


def _direct(call: Callable[[zenoh.Sample], None]) -> zenoh.handlers.Callback[zenoh.Sample]:
    return zenoh.handlers.Callback(call, indirect=False)


def _present(sample: zenoh.Sample) -> bool:
    return sample.kind == zenoh.SampleKind.PUT


def _gid(sample: zenoh.Sample) -> bytes:
    """The gid in a key; b"" for a foreign key."""
    try:
        return bytes.fromhex(str(sample.key_expr).rsplit("/", 1)[1])
    except ValueError:
        return b""
