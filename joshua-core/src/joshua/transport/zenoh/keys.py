"""Key expressions, liveliness tokens, QoS profiles and attachments of rmw_zenoh.

Source: ros2/rmw_zenoh, liveliness_utils.cpp, qos.cpp and attachment_helpers.cpp. A QoS profile is
``reliability:durability:history,depth:deadline s,ns:lifespan s,ns:liveliness,lease s,ns``, with the numbers
of rmw/types.h; a field that equals the middleware's default is empty.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from functools import lru_cache

import xxhash

from joshua.messages import dds_type_name, type_hash
from joshua.plan import QosProfile

_NS_PER_S = 1_000_000_000
_DEFAULT_DEPTH = 42  # of the middleware; a depth of 42 is written as an empty field
_INFINITE_S = 9_223_372_036


def write_qos(qos: QosProfile) -> str:
    """The text of a profile."""
    reliability = "2" if qos.reliability == "BEST_EFFORT" else ""
    durability = "1" if qos.durability == "TRANSIENT_LOCAL" else ""
    history = "2" if qos.history == "KEEP_ALL" else ""
    depth = "" if qos.depth == _DEFAULT_DEPTH else str(qos.depth)
    liveliness = "3" if qos.liveliness == "MANUAL_BY_TOPIC" else ""
    return ":".join(
        (
            reliability,
            durability,
            f"{history},{depth}",
            _write_duration(qos.deadline_s),
            _write_duration(qos.lifespan_s),
            f"{liveliness},{_write_duration(qos.lease_duration_s)}",
        )
    )


def read_qos(text: str) -> QosProfile:
    """Parse a profile. Values without an equivalent here get the nearest one.

    Raises:
        ValueError: the text does not have the format.
    """
    parts = text.split(":")
    if len(parts) < 6:
        raise ValueError(f"a QoS text has six parts, not {len(parts)}: {text!r}")
    history, depth = parts[2].split(",")[:2]
    liveliness, lease_s, lease_ns = parts[5].split(",")[:3]
    return QosProfile(
        reliability="BEST_EFFORT" if parts[0] == "2" else "RELIABLE",
        durability="TRANSIENT_LOCAL" if parts[1] == "1" else "VOLATILE",
        history="KEEP_ALL" if history == "2" else "KEEP_LAST",
        depth=int(depth) if depth else _DEFAULT_DEPTH,
        deadline_s=_read_duration(*parts[3].split(",")[:2]),
        lifespan_s=_read_duration(*parts[4].split(",")[:2]),
        liveliness="MANUAL_BY_TOPIC" if liveliness == "3" else "AUTOMATIC",
        lease_duration_s=_read_duration(lease_s, lease_ns),
    )


def _write_duration(duration_s: float) -> str:
    if duration_s <= 0:
        return ","
    seconds, nanoseconds = divmod(round(duration_s * _NS_PER_S), _NS_PER_S)
    return f"{seconds},{nanoseconds}"


def _read_duration(seconds: str, nanoseconds: str) -> float:
    whole = int(seconds) if seconds else _INFINITE_S
    if whole >= _INFINITE_S:
        return 0.0
    return whole + int(nanoseconds or 0) / _NS_PER_S


ADMIN_SPACE = "@ros2_lv"
NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT = "NN", "MP", "MS", "SS", "SC"
_KINDS = (NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT)
_NODE_PARTS, _TOPIC_PARTS = 9, 13
_GID_BYTES = 16

ATTACHMENT = struct.Struct(f"<qqB{_GID_BYTES}s")
"""Sequence number from 1, source time in ns since the epoch, length of the gid, gid."""


@dataclass(frozen=True)
class Entity:
    """A node or one of its endpoints, as a liveliness token describes it.

    Attributes:
        zid: Zenoh session; node_id, entity_id: numbers within it.
        kind: ``NN`` node, ``MP`` publisher, ``MS`` subscription, ``SS`` service, ``SC`` client.
        namespace: with leading slash.
        topic: fully qualified; "" for a node. type_name: DDS form. qos: None for a node.
        gid: 16 bytes that identify the entity in attachments.
    """

    domain_id: int
    zid: str
    node_id: str
    entity_id: str
    kind: str
    enclave: str
    namespace: str
    name: str
    topic: str = ""
    type_name: str = ""
    type_hash: str = ""
    qos: QosProfile | None = None

    @property
    def token(self) -> str:
        """The liveliness key."""
        parts = [
            ADMIN_SPACE,
            str(self.domain_id),
            self.zid,
            self.node_id,
            self.entity_id,
            self.kind,
            _mangle(self.enclave),
            _mangle(self.namespace),
            _mangle(self.name),
        ]
        if self.qos is not None:
            parts += [_mangle(self.topic), self.type_name, self.type_hash, write_qos(self.qos)]
        return "/".join(parts)

    @property
    def full_name(self) -> str:
        """Fully qualified name of the node."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    @property
    def gid(self) -> bytes:
        """Identity of the entity, 16 bytes."""
        return gid_of(self.token)


def _mangle(name: str) -> str:
    return name.replace("/", "%") or "%"


def _demangle(name: str) -> str:
    return name.replace("%", "/")


@lru_cache(maxsize=1024)
def gid_of(token: str) -> bytes:
    """Identity that belongs to a liveliness key: its XXH3-128, low half first."""
    digest = xxhash.xxh3_128_intdigest(token.encode())
    return digest.to_bytes(_GID_BYTES, "little")


def read_token(token: str) -> Entity:
    """Parses a liveliness key.

    Raises:
        ValueError: not a token of rmw_zenoh.
    """
    parts = token.split("/")
    if len(parts) < _NODE_PARTS or parts[0] != ADMIN_SPACE or parts[5] not in _KINDS:
        raise ValueError(f"not a liveliness token of a ROS 2 entity: {token!r}")
    if not token.isprintable():  # names are printed, and may come from anyone who reaches the router
        raise ValueError(f"a name contains characters that ROS 2 does not allow: {token!r}")
    enclave, namespace, name = (_demangle(part) for part in parts[6:9])
    node = Entity(int(parts[1]), parts[2], parts[3], parts[4], parts[5], enclave, namespace, name)
    if node.kind == NODE:
        return node
    if len(parts) < _TOPIC_PARTS:
        raise ValueError(f"the token of an endpoint lacks topic, type, hash or QoS: {token!r}")
    topic, type_name, hash_text = (_demangle(part) for part in parts[9:12])
    return replace(node, topic=topic, type_name=type_name, type_hash=hash_text, qos=read_qos(parts[12]))


def data_key(domain_id: int, topic: str, type_name: str) -> str:
    """Key of a topic's messages.

    Args:
        domain_id: ROS 2 domain.
        topic: fully qualified topic.
        type_name: ROS 2 type.
    """
    return f"{domain_id}/{topic.strip('/')}/{dds_type_name(type_name)}/{type_hash(type_name)}"
