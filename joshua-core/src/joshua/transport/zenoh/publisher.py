"""A publisher over Zenoh."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import zenoh
import zenoh.ext

from joshua.plan import QosProfile
from joshua.transport.transports import Buffer, Emit, Publisher, TransportError
from joshua.transport.zenoh.graph import Assertions, Matching
from joshua.transport.zenoh.keys import ATTACHMENT, Entity
from joshua.transport.zenoh.watch import Limit

if TYPE_CHECKING:
    from joshua.transport.zenoh.transport import ZenohNode

_HEARTBEAT_S = 0.5
_KEEP_ALL_CACHE = 100_000


class ZenohPublisher(Publisher):
    """Puts CDR payloads with the attachment of rmw_zenoh."""

    def __init__(self, node: ZenohNode, entity: Entity, key: str, qos: QosProfile, emit: Emit) -> None:
        super().__init__(node, entity.topic)
        home = self._home = node.home
        self._gid = entity.gid
        self._sequence = 0
        self._limits: list[Limit] = []
        if qos.deadline_s > 0:
            text = f"no message was published on {entity.topic} within {qos.deadline_s:g} s"
            limit = Limit(qos.deadline_s, lambda: emit("deadline-missed", text), repeat=True)
            self._limits.append(home.watch.add(limit))
        self._assertions: Assertions | None = None
        if qos.liveliness == "MANUAL_BY_TOPIC" and qos.lease_duration_s > 0:
            self._assertions = Assertions(home.session, entity.domain_id, self._gid)
            lost = f"liveliness on {entity.topic} was not asserted within {qos.lease_duration_s:g} s"
            limit = Limit(qos.lease_duration_s, lambda: emit("liveliness-lost", lost), repeat=False)
            self._limits.append(home.watch.add(limit))
        self._matching = Matching(home.graph, entity, lambda text: emit("incompatible-qos", text))
        self._publisher: Any = declare_publisher(home.session, key, qos)
        self._put = self._publisher.put
        self._token: Any = home.session.liveliness().declare_token(entity.token)
        home.graph.listen(entity.topic, self._matching.graph_changed)

    def publish(self, cdr: Buffer) -> None:
        """Send one serialised message."""
        payload = cdr if type(cdr) is bytes else _plain_bytes(cdr)
        with self._lock:
            if self._closed:
                raise TransportError(f"the publisher of {self.topic} is closed")
            self._sequence += 1
            attachment = ATTACHMENT.pack(self._sequence, time.time_ns(), 16, self._gid)
            self._put(payload, attachment=attachment)
        for limit in self._limits:
            limit.touch()

    @property
    def subscription_count(self) -> int:
        """Matched subscriptions."""
        return len(self._matching.connected)

    def assert_liveliness(self) -> None:
        """Assert that this publisher is alive."""
        if self._assertions is not None:
            self._assertions.send()
            self._limits[-1].touch()

    def _leave(self) -> None:
        self._home.graph.ignore(self.topic, self._matching.graph_changed)
        for limit in self._limits:
            self._home.watch.remove(limit)
        self._token.undeclare()
        if self._assertions is not None:
            self._assertions.close()
        self._publisher.undeclare()


def declare_publisher(session: zenoh.Session, key: str, qos: QosProfile) -> Any:
    """Declare the Zenoh publisher, with rmw_zenoh's settings for a profile."""
    reliable = qos.reliability == "RELIABLE"
    blocks = reliable and qos.history == "KEEP_ALL"
    settings: dict[str, Any] = {
        "reliability": zenoh.Reliability.RELIABLE if reliable else zenoh.Reliability.BEST_EFFORT,
        "congestion_control": zenoh.CongestionControl.BLOCK if blocks else zenoh.CongestionControl.DROP,
    }
    if qos.durability != "TRANSIENT_LOCAL":
        return session.declare_publisher(key, **settings)
    depth = _KEEP_ALL_CACHE if qos.history == "KEEP_ALL" else max(qos.depth, 1)
    settings["cache"] = zenoh.ext.CacheConfig(depth)
    settings["publisher_detection"] = True
    if reliable:
        settings["sample_miss_detection"] = zenoh.ext.MissDetectionConfig(
            heartbeat=None, sporadic_heartbeat=_HEARTBEAT_S
        )
    return zenoh.ext.declare_advanced_publisher(session, key, **settings)


def _plain_bytes(cdr: Buffer) -> bytes | bytearray:
    if isinstance(cdr, bytearray):
        return cdr
    whole = getattr(cdr, "obj", None)
    if isinstance(whole, (bytes, bytearray)) and len(whole) == cdr.nbytes:
        return whole
    return bytes(cdr)
