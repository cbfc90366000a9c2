"""A subscription over Zenoh."""

from __future__ import annotations

import logging
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
from joshua.transport.zenoh.graph import AssertionListener, Graph
from joshua.transport.zenoh.keys import ATTACHMENT, Entity
from joshua.transport.zenoh.matching import Matching

_log = logging.getLogger("joshua.transport")
# a channel of Zenoh has a bound; this one stands for none
_UNBOUNDED = 2**31
Handle = Callable[[zenoh.Sample], None]


class ChannelIntake:
    """A channel of Zenoh itself: its network thread needs no Python to fill it.

    That saves the hand-over of the interpreter between two threads, about half of a small message's
    latency. Nothing of ours sees a sample arrive; it is seen when it is taken.

    Args:
        name: name of the thread.
        depth: length of the queue, the newest stay; None keeps everything.
        deliver: called with each sample on the thread.
        arrived: not called by this form.
    """

    def __init__(self, name: str, depth: int | None, deliver: Handle, arrived: Handle) -> None:
        self.handler: Any = (
            zenoh.handlers.FifoChannel(_UNBOUNDED) if depth is None else zenoh.handlers.RingChannel(depth)
        )
        self._name, self._deliver = name, deliver
        self._closed = False
        self._thread: threading.Thread | None = None

    def start(self, subscriber: Any) -> None:
        """Begins to deliver what the declared subscriber receives."""
        self._thread = threading.Thread(target=self._run, args=(subscriber,), name=self._name, daemon=True)
        self._thread.start()

    def close(self, undeclare: Callable[[], None]) -> None:
        """Undeclares the subscriber and ends the thread; nothing is delivered after the return."""
        self._closed = True
        undeclare()
        if self._thread is not None and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self, subscriber: Any) -> None:
        receive, deliver = subscriber.handler.recv, self._deliver
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
            # a sample kept here would keep its buffer until the next one arrives
            del sample


class WatchedIntake:
    """A queue of ours, for subscriptions with a deadline or a lease: arrivals count when they happen.

    Args:
        name: name of the thread.
        depth: length of the queue, the newest stay; None keeps everything.
        deliver: called with each sample on the thread.
        arrived: called with each sample on the network thread.
    """

    def __init__(self, name: str, depth: int | None, deliver: Handle, arrived: Handle) -> None:
        self._delivery = Delivery(name, depth, deliver)
        self._arrived = arrived
        self.handler: Any = zenoh.handlers.Callback(self._take, indirect=False)

    def start(self, subscriber: Any) -> None:
        """Nothing to begin: the handler delivers from the first sample on."""

    def close(self, undeclare: Callable[[], None]) -> None:
        """Undeclares the subscriber and ends the thread; nothing is delivered after the return."""
        undeclare()
        self._delivery.close()

    def _take(self, sample: zenoh.Sample) -> None:
        self._delivery.push(sample)
        self._arrived(sample)


_UNKNOWN = (0, 0, 0, b"")


class ZenohSubscription(Subscription):
    """Hands out samples on a thread of its own, from a queue that the network thread fills."""

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
        watched = watches_lease or self._deadline is not None
        self._intake = (WatchedIntake if watched else ChannelIntake)(
            f"joshua-sub {entity.topic}", depth, self._deliver, self._sign_of_life
        )
        # told before data flows, so that a publisher's assertions are not missed
        self._assertions = (
            AssertionListener(session, entity.domain_id, self._publisher_marked, self._alive)
            if watches_lease
            else None
        )
        self._subscriber: Any = _declare(session, key, qos, self._intake.handler)
        self._intake.start(self._subscriber)
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
        self._intake.close(self._subscriber.undeclare)
        if self._assertions is not None:
            self._assertions.close()
        for limit in (self._deadline, *self._leases.values()):
            if limit is not None:
                self._watch.remove(limit)

    def _sign_of_life(self, sample: zenoh.Sample) -> None:
        """Counts deadline and lease anew at the arrival of a sample."""
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
            self._watch.remove(limit)
        self._emit("liveliness-lost", f"the publisher of {publisher.full_name} left {publisher.topic}")

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
                f"the publisher of {publisher.full_name} on {publisher.topic} did not assert its "
                f"liveliness within {lease_s:g} s"
            )
            limit = Limit(lease_s, lambda: self._emit("liveliness-lost", text), repeat=False)
            self._leases = {**self._leases, gid: self._watch.add(limit)}
        limit.touch()


def _head(sample: zenoh.Sample) -> tuple[int, int, int, bytes]:
    """Sequence, source time, gid length and gid of a sample; zeros where another program sent none."""
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
