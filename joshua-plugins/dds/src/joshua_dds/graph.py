"""The ROS 2 graph over DDS: endpoints from discovery, joined with nodes announced by participants.

Readers keep samples until they are taken. A thread takes new samples and those of participants that have
left, so that a process that never reads the graph does not grow with all that others announce and close.
"""

from __future__ import annotations

import threading
from typing import Any

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    GuardCondition,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import dds_infinity
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from joshua.api.transports import NAMELESS, EndpointInfo, NodeInfo
from joshua.messages import distro
from joshua.messages.typestore import shown_type_name

from joshua_dds import discovery_info, raw
from joshua_dds.discovery_info import NodeEntry
from joshua_dds.qos import XCDR1, read_qos, read_type_hash, user_data

_PREFIX = "rt/"
_HUMBLE_GID_BYTES, _GID_BYTES = 24, 16
_PARTICIPANTS, _WRITERS, _READERS = range(3)  # what discovery reports, in the order of its readers here
_ENOUGH = 100_000
_AT_ONCE = 256
_ANY = SampleState.Any | ViewState.Any
_ALIVE = _ANY | InstanceState.Alive
_GONE = _ANY | InstanceState.NotAliveDisposed | InstanceState.NotAliveNoWriters


class Graph:
    """Announces the nodes of this participant and reads those of the others."""

    def __init__(self, participant: DomainParticipant) -> None:
        self._lock = threading.Lock()
        self._guid: bytes = participant.guid.bytes
        self._type = discovery_info.info_type(_HUMBLE_GID_BYTES if distro() == "humble" else _GID_BYTES)
        base = Qos(
            Policy.Reliability.Reliable(100_000_000),
            Policy.Durability.TransientLocal,
            Policy.DurabilityService(0, Policy.History.KeepLast(1), -1, -1, -1),
            XCDR1,
            *user_data(discovery_info.TYPE_NAME),  # rmw_cyclonedds warns of endpoints without a hash
        )
        topic: Any = Topic(participant, discovery_info.TOPIC, self._type)
        with raw.READING_QOS:
            self._writer: Any = DataWriter(participant, topic, qos=base + Qos(Policy.History.KeepLast(1)))
        self._reader: Any = DataReader(participant, topic, qos=base + Qos(Policy.History.KeepAll))
        self._builtin = [
            (
                reader := BuiltinDataReader(participant, kind),
                ReadCondition(reader, _ALIVE),
                ReadCondition(reader, _GONE),
            )
            for kind in (
                BuiltinTopicDcpsParticipant,
                BuiltinTopicDcpsPublication,
                BuiltinTopicDcpsSubscription,
            )
        ]
        self._own: dict[int, NodeEntry] = {}
        self._others: dict[bytes, list[NodeEntry]] = {}
        self._closed = False
        self._news = ReadCondition(self._reader, _ANY | InstanceState.Any)
        self._stop: Any = GuardCondition(participant)
        self._waitset: Any = WaitSet(participant)
        for condition in (self._stop, self._news, *(gone for _, _, gone in self._builtin)):
            self._waitset.attach(condition)
        self._thread = threading.Thread(target=self._run, name="joshua-dds-graph", daemon=True)
        self._thread.start()

    def announce(self, key: int, entry: NodeEntry | None) -> None:
        """Announce the endpoints of a node of this process; None withdraws the node."""
        with self._lock:
            if entry is None:
                self._own.pop(key, None)
            else:
                self._own[key] = entry
            self._writer.write(discovery_info.pack(self._type, self._guid, list(self._own.values())))

    def nodes(self) -> list[NodeInfo]:
        """Return all nodes with their publishers and subscriptions, sorted by name."""
        with self._lock:
            alive, writers, readers = map(self._alive, (_PARTICIPANTS, _WRITERS, _READERS))
            self._take_announcements()
            known = {**self._others, self._guid: list(self._own.values())}
        endpoints = {
            guid: _endpoint(sample, is_publisher)
            for samples, is_publisher in ((writers, True), (readers, False))
            for guid, sample in samples.items()
            if sample.topic_name.startswith(_PREFIX)
            and f"{sample.topic_name}{sample.type_name}".isprintable()
        }
        found = []
        for guid, entries in known.items():
            if guid in alive:
                found += [_node(entry, endpoints) for entry in entries]
        if endpoints:
            # the rest belongs to no node: programs that use DDS without ROS 2
            found.append(_node(NodeEntry(NAMELESS, NAMELESS, (), tuple(endpoints)), endpoints))
        return sorted(found, key=lambda node: (node.namespace, node.name))

    def owner(self, publisher_gid: bytes) -> str:
        """Return the full name of the node that owns a writer; "" if no announcement names it."""
        with self._lock:
            self._take_announcements()
            announced = [entry for entries in self._others.values() for entry in entries]
            announced += self._own.values()
        return next((entry.full_name for entry in announced if publisher_gid in entry.writers), "")

    def _alive(self, kind: int) -> dict[bytes, Any]:
        """Return the participants, writers or readers from discovery, by guid."""
        reader, condition, _ = self._builtin[kind]
        with raw.READING_QOS:
            return {sample.key.bytes: sample for sample in reader.read(_ENOUGH, condition)}

    def _take_announcements(self) -> None:
        while samples := self._reader.take(_AT_ONCE):
            for sample in samples:
                if hasattr(sample, "node_entities_info_seq"):
                    guid, entries = discovery_info.unpack(sample)
                    self._others[guid] = entries

    def _run(self) -> None:
        while True:
            self._waitset.wait(dds_infinity)
            if self._closed:
                return
            with self._lock:
                self._take_announcements()
                self._forget_the_gone()

    def _forget_the_gone(self) -> None:
        """Take the remaining samples of participants and endpoints that have left, and drop their nodes."""
        left = False
        for reader, _, gone in self._builtin:
            with raw.READING_QOS:
                while reader.take(_AT_ONCE, gone):
                    left = True
        if left:
            alive = self._alive(_PARTICIPANTS)
            self._others = {guid: entries for guid, entries in self._others.items() if guid in alive}

    def close(self) -> None:
        """Withdraw the announcement."""
        self._closed = True
        raw.trigger(self._stop)
        if threading.current_thread() is not self._thread:
            self._thread.join()
        conditions = (self._stop, self._news, *(gone for _, _, gone in self._builtin))
        for condition in conditions:
            self._waitset.detach(condition)
        for entity in (self._waitset, *conditions):
            raw.delete(entity)
        for reader, condition, _ in self._builtin:
            raw.delete(condition)
            raw.delete(reader)
        raw.delete(self._writer)
        raw.delete(self._reader)


def _endpoint(sample: Any, is_publisher: bool) -> dict[str, Any]:
    return {
        "topic": "/" + sample.topic_name.removeprefix(_PREFIX),
        "type_name": shown_type_name(sample.type_name),
        "type_hash": read_type_hash(sample.qos),
        "is_publisher": is_publisher,
        "qos": read_qos(sample.qos),
    }


def _node(entry: NodeEntry, endpoints: dict[bytes, dict[str, Any]]) -> NodeInfo:
    owned = [endpoints.pop(gid) for gid in (*entry.writers, *entry.readers) if gid in endpoints]
    return NodeInfo(
        name=entry.name,
        namespace=entry.namespace,
        endpoints=tuple(
            EndpointInfo(node_name=entry.name, node_namespace=entry.namespace, **values) for values in owned
        ),
    )
