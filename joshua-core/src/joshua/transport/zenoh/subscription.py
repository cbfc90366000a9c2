"""A subscription over Zenoh."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh
import zenoh.ext

from joshua.plan import QosProfile
from joshua.transport.api import Sample, Subscription
from joshua.transport.delivery import Delivery
from joshua.transport.watch import Limit, Watch
from joshua.transport.zenoh.graph import Graph
from joshua.transport.zenoh.keys import ATTACHMENT, Entity
from joshua.transport.zenoh.liveliness import AssertionListener
from joshua.transport.zenoh.matching import Matching

_NS_PER_S = 1_000_000_000
_UNKNOWN = (0, 0, 0, b"")


class ZenohSubscription(Subscription):
    """Queues samples on the network thread and hands them out on a thread of its own."""

    def __init__(
        self,
        session: zenoh.Session,
        graph: Graph,
        watch: Watch,
        entity: Entity,
        key: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Callable[[str, str], None],
    ) -> None:
        self._graph, self._watch, self._entity, self._emit = graph, watch, entity, emit
        self._callback = callback
        self._closed = False
        self._lock = threading.Lock()
        self._deadline: Limit | None = None
        if qos.deadline_s > 0:
            text = f"no message came on {entity.topic} within {qos.deadline_s:g} s"
            limit = Limit(qos.deadline_s, lambda: emit("deadline-missed", text), repeat=True)
            self._deadline = watch.add(limit)
        self._leases: dict[bytes, Limit] = {}
        self._marked: set[bytes] = set()
        watches_lease = qos.lease_duration_s > 0
        self._matching = Matching(
            entity,
            lambda text: emit("incompatible-qos", text),
            self._publisher_left if watches_lease else None,
        )
        graph.listen(entity.topic, self._matching.graph_changed)
        depth = None if qos.history == "KEEP_ALL" else max(qos.depth, 1)
        self._delivery = Delivery(f"joshua-sub {entity.topic}", depth, self._deliver)
        # told before data flows, so that a publisher's assertions are not missed
        self._assertions = (
            AssertionListener(session, entity.domain_id, self._publisher_marked, self._alive)
            if watches_lease
            else None
        )
        self._subscriber: Any = _declare(session, key, qos, self._on_sample)
        self._token: Any = session.liveliness().declare_token(entity.token)

    @property
    def publisher_count(self) -> int:
        """Matched publishers."""
        return len(self._matching.connected)

    def close(self) -> None:
        """Leaves the graph."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self._graph.ignore(self._entity.topic, self._matching.graph_changed)
        self._token.undeclare()
        self._subscriber.undeclare()
        if self._assertions is not None:
            self._assertions.close()
        for limit in (self._deadline, *self._leases.values()):
            if limit is not None:
                self._watch.remove(limit)
        self._delivery.close()

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Runs on the network thread: as little as possible happens here."""
        received_ns = time.time_ns()
        attachment = sample.attachment
        head = _UNKNOWN
        if attachment is not None:
            raw = attachment.to_bytes()
            if len(raw) == ATTACHMENT.size:
                head = ATTACHMENT.unpack(raw)
        if head[3] in self._matching.refused:
            return
        self._delivery.push((sample, head, received_ns))
        if self._deadline is not None:
            self._deadline.touch()
        if self._leases:
            self._alive(head[3])

    def _deliver(self, item: tuple[zenoh.Sample, tuple[int, int, int, bytes], int]) -> None:
        sample, (sequence, source_ns, _, gid), received_ns = item
        publisher = self._matching.connected.get(gid)
        if publisher is not None and publisher.qos is not None and publisher.qos.lifespan_s > 0:
            age_ns = time.time_ns() - source_ns
            if age_ns > publisher.qos.lifespan_s * _NS_PER_S:
                return
        self._callback(Sample(sample.payload.to_bytes(), source_ns, received_ns, sequence, gid))

    def _publisher_left(self, publisher: Entity) -> None:
        limit = self._leases.pop(publisher.gid, None)
        if limit is not None:
            self._watch.remove(limit)
        self._emit("liveliness-lost", f"the publisher of {_full_name(publisher)} left {publisher.topic}")

    def _publisher_marked(self, gid: bytes) -> None:
        self._marked.add(gid)
        self._alive(gid)

    def _alive(self, gid: bytes) -> None:
        """Counts the lease of a publisher anew; the first sign of life begins the count."""
        limit = self._leases.get(gid)
        if limit is None:
            publisher = self._matching.connected.get(gid)
            if gid not in self._marked or publisher is None or publisher.qos is None:
                return
            lease_s = publisher.qos.lease_duration_s
            text = (
                f"the publisher of {_full_name(publisher)} on {publisher.topic} did not assert its "
                f"liveliness within {lease_s:g} s"
            )
            limit = Limit(lease_s, lambda: self._emit("liveliness-lost", text), repeat=False)
            self._leases = {**self._leases, gid: self._watch.add(limit)}
        limit.touch()


def _full_name(entity: Entity) -> str:
    return f"{entity.namespace.rstrip('/')}/{entity.name}"


def _declare(session: zenoh.Session, key: str, qos: QosProfile, on_sample: Callable[[Any], None]) -> Any:
    handler = zenoh.handlers.Callback(on_sample, indirect=False)
    if qos.durability != "TRANSIENT_LOCAL":
        return session.declare_subscriber(key, handler)
    depth = None if qos.history == "KEEP_ALL" else max(qos.depth, 1)
    settings: dict[str, Any] = {
        "history": zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=depth),
        "subscriber_detection": True,
    }
    if qos.reliability == "RELIABLE":
        settings["recovery"] = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    return zenoh.ext.declare_advanced_subscriber(session, key, handler, **settings)
