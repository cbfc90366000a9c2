"""The ROS 2 graph over DDS: what discovery knows of endpoints, joined with what participants say of nodes."""

from __future__ import annotations

import threading
from typing import Any

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from joshua.messages import distro
from joshua.messages.names import shown_type_name
from joshua.transport.api import EndpointInfo, NodeInfo
from joshua.transport.dds import discovery_info, raw
from joshua.transport.dds.discovery_info import NodeEntry
from joshua.transport.dds.qos import XCDR1, read_qos, read_type_hash
from joshua.transport.names import NAMELESS

_PREFIX = "rt/"
_HUMBLE_GID_BYTES, _GID_BYTES = 24, 16
_ENOUGH = 100_000
_ALIVE = SampleState.Any | ViewState.Any | InstanceState.Alive


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
        )
        topic: Any = Topic(participant, discovery_info.TOPIC, self._type)
        self._writer: Any = DataWriter(participant, topic, qos=base + Qos(Policy.History.KeepLast(1)))
        self._reader: Any = DataReader(participant, topic, qos=base + Qos(Policy.History.KeepAll))
        self._builtin = [
            (reader := BuiltinDataReader(participant, kind), ReadCondition(reader, _ALIVE))
            for kind in (
                BuiltinTopicDcpsParticipant,
                BuiltinTopicDcpsPublication,
                BuiltinTopicDcpsSubscription,
            )
        ]
        self._own: dict[int, NodeEntry] = {}
        self._others: dict[bytes, list[NodeEntry]] = {}

    def announce(self, key: int, entry: NodeEntry | None) -> None:
        """Says what a node of this process owns; None says that it is gone."""
        with self._lock:
            if entry is None:
                self._own.pop(key, None)
            else:
                self._own[key] = entry
            self._writer.write(discovery_info.pack(self._type, self._guid, list(self._own.values())))

    def nodes(self) -> list[NodeInfo]:
        """All nodes with their publishers and subscriptions, sorted by name."""
        with self._lock:
            alive, writers, readers = (
                {sample.key.bytes: sample for sample in reader.read(_ENOUGH, condition)}
                for reader, condition in self._builtin
            )
            self._take_announcements()
            known = {**self._others, self._guid: list(self._own.values())}
            self._others = {guid: entries for guid, entries in self._others.items() if guid in alive}
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
            # what is left belongs to no node: programs that speak DDS without ROS 2
            found.append(_node(NodeEntry(NAMELESS, NAMELESS, (), tuple(endpoints)), endpoints))
        return sorted(found, key=lambda node: (node.namespace, node.name))

    def owner(self, publisher_gid: bytes) -> str:
        """Full name of the node that owns a writer; "" where no announcement names it."""
        with self._lock:
            self._take_announcements()
            announced = [entry for entries in self._others.values() for entry in entries]
            announced += self._own.values()
        return next((entry.full_name for entry in announced if publisher_gid in entry.writers), "")

    def _take_announcements(self) -> None:
        for sample in self._reader.take(_ENOUGH):
            if hasattr(sample, "node_entities_info_seq"):
                guid, entries = discovery_info.unpack(sample)
                self._others[guid] = entries

    def close(self) -> None:
        """Withdraws the announcement."""
        for reader, condition in self._builtin:
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
