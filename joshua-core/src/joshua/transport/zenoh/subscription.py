"""A subscription over Zenoh."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import zenoh
import zenoh.ext

from joshua.plan import QosProfile
from joshua.transport.delivery import Delivery
from joshua.transport.transports import Emit, Sample, Subscription
from joshua.transport.zenoh.graph import AssertionListener, Matching
from joshua.transport.zenoh.keys import ATTACHMENT, Entity
from joshua.transport.zenoh.watch import Limit

if TYPE_CHECKING:
    from joshua.transport.zenoh.transport import ZenohNode

_log = logging.getLogger("joshua.transport")
# a channel of Zenoh is always bounded; this is large enough for KEEP_ALL
_UNBOUNDED = 2**31
_UNKNOWN = (0, 0, 0, b"")


class ZenohSubscription(Subscription):
    """Passes samples to the callback on a separate thread, from a queue that the network thread fills.

    The queue is a channel of Zenoh, which is filled without Python. That avoids switching the interpreter
    between two threads, about half of a small message's latency. With a deadline or a lease, the queue is a
    ``Delivery``, because the time of each arrival matters.
    """

    def __init__(
        self,
        node: ZenohNode,
        entity: Entity,
        key: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Emit,
    ) -> None:
        super().__init__(node, entity.topic)
        home = self._home = node.home
        self._entity, self._callback, self._emit = entity, callback, emit
        self._deadline: Limit | None = None
        if qos.deadline_s > 0:
            text = f"no message received on {entity.topic} within {qos.deadline_s:g} s"
            limit = Limit(qos.deadline_s, lambda: emit("deadline-missed", text), repeat=True)
            self._deadline = home.watch.add(limit)
        self._leases: dict[bytes, Limit] = {}
        self._marked: set[bytes] = set()
        watches_lease = qos.lease_duration_s > 0
        self._matching = Matching(
            home.graph,
            entity,
            lambda text: emit("incompatible-qos", text),
            self._publisher_left if watches_lease else None,
        )
        home.graph.listen(entity.topic, self._matching.graph_changed)
        depth = None if qos.history == "KEEP_ALL" else max(qos.depth, 1)
        self._name = f"joshua-sub {entity.topic}"
        self._delivery: Delivery | None = None
        handler: Any
        if watches_lease or self._deadline is not None:
            self._delivery = Delivery(self._name, depth, self._deliver)
            handler = zenoh.handlers.Callback(self._arrived, indirect=False)
        elif depth is None:
            handler = zenoh.handlers.FifoChannel(_UNBOUNDED)
        else:
            handler = zenoh.handlers.RingChannel(depth)
        # declared before data arrives, so that a publisher's assertions are not missed
        self._assertions = (
            AssertionListener(home.session, entity.domain_id, self._publisher_marked, self._alive)
            if watches_lease
            else None
        )
        self._subscriber: Any = _declare(home.session, key, qos, handler)
        self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
        if self._delivery is None:
            self._thread.start()
        self._token: Any = home.session.liveliness().declare_token(entity.token)

    @property
    def publisher_count(self) -> int:
        """Matched publishers."""
        return len(self._matching.connected)

    def _leave(self) -> None:
        self._home.graph.ignore(self.topic, self._matching.graph_changed)
        self._token.undeclare()
        self._subscriber.undeclare()
        if self._delivery is not None:
            self._delivery.close()
        elif threading.current_thread() is not self._thread:
            self._thread.join()
        if self._assertions is not None:
            self._assertions.close()
        for limit in (self._deadline, *self._leases.values()):
            if limit is not None:
                self._home.watch.remove(limit)

    def _run(self) -> None:
        receive, deliver = self._subscriber.handler.recv, self._deliver
        while True:
            try:
                sample = receive()
            except zenoh.ZError:
                return  # undeclared
            if self._closed:
                return
            try:
                deliver(sample)
            except Exception:  # noqa: BLE001 - a failing callback must not end the subscription
                _log.exception("the callback of %s failed", self._name)
            # a reference here would keep its buffer until the next one arrives
            del sample

    def _arrived(self, sample: zenoh.Sample) -> None:
        """Queue a sample and restart deadline and lease. Runs on the network thread."""
        assert self._delivery is not None
        self._delivery.push(sample)
        gid = _head(sample)[3]
        if gid in self._matching.refused:
            return
        if self._deadline is not None:
            self._deadline.touch()
        if self._leases:
            self._alive(gid)

    def _deliver(self, sample: zenoh.Sample) -> None:
        now_ns = time.time_ns()
        sequence, source_ns, _, gid = _head(sample)
        matching = self._matching
        if gid in matching.refused:
            return
        lifespan_ns = matching.lifespans_ns.get(gid)
        if lifespan_ns is not None and now_ns - source_ns > lifespan_ns:
            return
        self._callback(Sample(sample.payload.to_bytes(), source_ns, now_ns, sequence, gid))

    def _publisher_left(self, publisher: Entity) -> None:
        limit = self._leases.pop(publisher.gid, None)
        if limit is not None:
            self._home.watch.remove(limit)
        self._emit("liveliness-lost", f"the publisher of {publisher.full_name} left {publisher.topic}")

    def _publisher_marked(self, gid: bytes) -> None:
        self._marked.add(gid)
        self._alive(gid)

    def _alive(self, gid: bytes) -> None:
        """Restart the lease of a publisher. The first assertion starts it."""
        limit = self._leases.get(gid)
        if limit is None:
            publisher = self._matching.connected.get(gid)
            if gid not in self._marked or publisher is None or publisher.qos is None:
                return
            lease_s = publisher.qos.lease_duration_s
            text = (
                f"the publisher of {publisher.full_name} on {publisher.topic} did not assert its "
                f"liveliness within {lease_s:g} s"
            )
            limit = Limit(lease_s, lambda: self._emit("liveliness-lost", text), repeat=False)
            self._leases = {**self._leases, gid: self._home.watch.add(limit)}
        limit.touch()


def _head(sample: zenoh.Sample) -> tuple[int, int, int, bytes]:
    """Sequence, source time, gid length and gid of a sample; zeros if its publisher sent none."""
    attachment = sample.attachment
    if attachment is not None:
        raw = attachment.to_bytes()
        if len(raw) == ATTACHMENT.size:
            sequence, source_ns, length, gid = ATTACHMENT.unpack(raw)
            return sequence, source_ns, length, gid
    return _UNKNOWN


def _declare(session: zenoh.Session, key: str, qos: QosProfile, handler: Any) -> Any:
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
