"""The ROS 2 graph as the liveliness tokens of a domain describe it, and manual liveliness between our nodes.

rmw_zenoh has no manual liveliness. A publisher with MANUAL_BY_TOPIC marks itself with the token
``@joshua_alive/<domain>/<gid>`` and puts an empty message on the same key when it asserts that it is alive.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from joshua.messages.names import shown_type_name
from joshua.transport.api import EndpointInfo, NodeInfo
from joshua.transport.zenoh.keys import NODE, PUBLISHER, SUBSCRIPTION, Entity, read_token

_log = logging.getLogger("joshua.transport")
Listener = Callable[[Entity, bool], None]


class Graph:
    """Every entity of the domain; tells listeners of each topic what comes and goes."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # held while listeners are told, so that each hears of an entity in the order of the news
        self._telling = threading.RLock()
        self._entities: dict[str, Entity] = {}
        self._listeners: dict[str, list[Listener]] = {}

    def apply(self, token: str, present: bool) -> None:
        """Takes in that a liveliness token appeared or vanished; the same news twice does nothing."""
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
                listeners = list(self._listeners.get(entity.topic, ()))
            for listener in listeners:
                listener(entity, present)

    def listen(self, topic: str, listener: Listener) -> None:
        """Calls ``listener(entity, present)`` for the endpoints of a topic, those known included."""
        with self._telling:
            with self._lock:
                self._listeners.setdefault(topic, []).append(listener)
                known = [entity for entity in self._entities.values() if entity.topic == topic]
            for entity in known:
                listener(entity, True)

    def ignore(self, topic: str, listener: Listener) -> None:
        """Ends the calls to a listener."""
        with self._lock:
            listeners = self._listeners.get(topic, [])
            if listener in listeners:
                listeners.remove(listener)

    def owner(self, publisher_gid: bytes) -> str:
        """Full name of the node that owns a publisher; "" where no token names it."""
        with self._lock:
            publishers = [entity for entity in self._entities.values() if entity.kind == PUBLISHER]
        return next((entity.full_name for entity in publishers if entity.gid == publisher_gid), "")

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
            elif entity.kind == NODE:
                endpoints.setdefault(key, [])
        found = [
            NodeInfo(name=name, namespace=namespace, endpoints=tuple(endpoints.get(key, ())))
            for key, (namespace, name) in names.items()
        ]
        return sorted(found, key=lambda node: (node.namespace, node.name))


_SPACE = "@joshua_alive"


class Assertions:
    """The publisher's side."""

    def __init__(self, session: zenoh.Session, domain_id: int, gid: bytes) -> None:
        key = f"{_SPACE}/{domain_id}/{gid.hex()}"
        self._publisher: Any = session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.BLOCK
        )
        self._token: Any = session.liveliness().declare_token(key)

    def send(self) -> None:
        """Asserts that the publisher is alive."""
        self._publisher.put(b"")

    def close(self) -> None:
        """Withdraws the mark."""
        self._token.undeclare()
        self._publisher.undeclare()


class AssertionListener:
    """The subscription's side.

    Args:
        marked: called with a gid whose publisher asserts by hand.
        asserted: called with the gid of each assertion.
    """

    def __init__(
        self,
        session: zenoh.Session,
        domain_id: int,
        marked: Callable[[bytes], None],
        asserted: Callable[[bytes], None],
    ) -> None:
        key = f"{_SPACE}/{domain_id}/*"
        self._subscriber: Any = session.declare_subscriber(
            key, _direct(lambda sample: asserted(_gid(sample)))
        )
        self._tokens: Any = session.liveliness().declare_subscriber(
            key,
            _direct(lambda sample: marked(_gid(sample)) if sample.kind == zenoh.SampleKind.PUT else None),
            history=True,
        )

    def close(self) -> None:
        """Stops listening."""
        self._tokens.undeclare()
        self._subscriber.undeclare()


def _direct(call: Callable[[zenoh.Sample], None]) -> zenoh.handlers.Callback[zenoh.Sample]:
    return zenoh.handlers.Callback(call, indirect=False)


def _gid(sample: zenoh.Sample) -> bytes:
    """The gid in a key; b"" for a key of somebody else's making."""
    try:
        return bytes.fromhex(str(sample.key_expr).rsplit("/", 1)[1])
    except ValueError:
        return b""
