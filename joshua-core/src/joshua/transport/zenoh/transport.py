"""One process's connection to the ROS 2 graph over Zenoh."""

from __future__ import annotations

import atexit
import itertools
import os
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from joshua.plan import TransportSpec
from joshua.transport.api import NodeHandle, NodeInfo, Transport
from joshua.transport.delivery import Delivery
from joshua.transport.errors import TransportError
from joshua.transport.names import require_node
from joshua.transport.watch import Watch
from joshua.transport.zenoh.graph import Graph
from joshua.transport.zenoh.keys import ADMIN_SPACE, NODE, Entity
from joshua.transport.zenoh.node import EventCallback, ZenohNode
from joshua.transport.zenoh.settings import close_session, open_session, own_router, session_config


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
