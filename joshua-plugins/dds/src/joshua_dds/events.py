"""QoS events of readers and writers: one thread that waits for their status changes.

Listeners would call Python from the receive threads of DDS, which may hold locks that another thread
needs while it holds the interpreter; a waiting thread cannot deadlock that way.
"""

from __future__ import annotations

import threading
from typing import Any

from cyclonedds.core import DDSStatus, GuardCondition, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import dds_infinity
from joshua.api.transports import Emit, QosProfile

from joshua_dds import raw
from joshua_dds.qos import POLICY_NAMES


class EventSource:
    """Endpoint whose events are reported."""

    def __init__(self, entity: Any, topic: str, qos: QosProfile, is_writer: bool, emit: Emit) -> None:
        self.entity, self._topic, self._qos, self._emit = entity, topic, qos, emit
        self._is_writer = is_writer
        self.mask = (
            DDSStatus.OfferedDeadlineMissed | DDSStatus.OfferedIncompatibleQos | DDSStatus.LivelinessLost
            if is_writer
            else DDSStatus.RequestedDeadlineMissed
            | DDSStatus.RequestedIncompatibleQos
            | DDSStatus.LivelinessChanged
        )
        self._alive = 0

    def report(self) -> None:
        """Turn the status changes since the last call into events."""
        changed = self.entity.take_status(self.mask)
        if not changed:
            return
        entity, topic = self.entity, self._topic
        if self._is_writer:
            if changed & DDSStatus.OfferedDeadlineMissed:
                entity.get_offered_deadline_missed_status()
                limit = f"{self._qos.deadline_s:g} s"
                self._emit("deadline-missed", f"no message was published on {topic} within {limit}")
            if changed & DDSStatus.LivelinessLost:
                entity.get_liveliness_lost_status()
                limit = f"{self._qos.lease_duration_s:g} s"
                self._emit("liveliness-lost", f"liveliness on {topic} was not asserted within {limit}")
            if changed & DDSStatus.OfferedIncompatibleQos:
                self._incompatible(entity.get_offered_incompatible_qos_status(), "subscription")
            return
        if changed & DDSStatus.RequestedDeadlineMissed:
            entity.get_requested_deadline_missed_status()
            limit = f"{self._qos.deadline_s:g} s"
            self._emit("deadline-missed", f"no message received on {topic} within {limit}")
        if changed & DDSStatus.LivelinessChanged:
            status = entity.get_liveliness_changed_status()
            lost = status.alive_count < self._alive
            self._alive = status.alive_count
            if lost and self._qos.lease_duration_s > 0:
                self._emit("liveliness-lost", f"a publisher of {topic} lost its liveliness")
        if changed & DDSStatus.RequestedIncompatibleQos:
            self._incompatible(entity.get_requested_incompatible_qos_status(), "publisher")

    def _incompatible(self, status: Any, side: str) -> None:
        policy = POLICY_NAMES.get(status.last_policy_id, f"policy {status.last_policy_id}")
        self._emit("incompatible-qos", f"a {side} on {self._topic} does not connect: {policy} differs")


class Events:
    """Waits for the status changes of all sources; the thread exists only while there are any."""

    def __init__(self, participant: DomainParticipant) -> None:
        self._participant = participant
        self._lock = threading.Lock()
        self._sources: list[EventSource] = []
        self._thread: threading.Thread | None = None
        self._waitset: Any = None
        self._stop: Any = None
        self._closed = False

    def add(self, source: EventSource) -> None:
        """Report the events of an endpoint."""
        with self._lock:
            if self._thread is None:
                self._waitset, self._stop = WaitSet(self._participant), GuardCondition(self._participant)
                self._waitset.attach(self._stop)
                self._thread = threading.Thread(target=self._run, name="joshua-dds-events", daemon=True)
                self._thread.start()
            source.entity.set_status_mask(source.mask)
            self._sources.append(source)
            self._waitset.attach(source.entity)

    def remove(self, entity: Any) -> None:
        """Stop reporting the events of an endpoint; an unknown one has no effect."""
        with self._lock:
            for source in [source for source in self._sources if source.entity is entity]:
                self._waitset.detach(entity)
                self._sources.remove(source)

    def close(self) -> None:
        """End the thread."""
        if self._thread is None:
            return
        self._closed = True
        raw.trigger(self._stop)
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._waitset.detach(self._stop)
        raw.delete(self._waitset)
        raw.delete(self._stop)

    def _run(self) -> None:
        while True:
            self._waitset.wait(dds_infinity)
            if self._closed:
                return
            with self._lock:
                for source in self._sources:
                    source.report()
