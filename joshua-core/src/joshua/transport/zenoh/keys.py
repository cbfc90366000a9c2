"""Key expressions, liveliness tokens and attachments of rmw_zenoh.

Source: ros2/rmw_zenoh, liveliness_utils.cpp (Entity, TopicInfo) and attachment_helpers.cpp.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from functools import lru_cache

import xxhash

from joshua.messages import dds_type_name, type_hash
from joshua.plan import QosProfile
from joshua.transport.zenoh.qos_text import read_qos, write_qos

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
        zid: Zenoh session; node_id, entity_id: running numbers in it.
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
    if not token.isprintable():  # names end up on terminals, and come from whoever reaches the router
        raise ValueError(f"a name holds characters that no name of ROS 2 has: {token!r}")
    enclave, namespace, name = (_demangle(part) for part in parts[6:9])
    node = Entity(int(parts[1]), parts[2], parts[3], parts[4], parts[5], enclave, namespace, name)
    if node.kind == NODE:
        return node
    if len(parts) < _TOPIC_PARTS:
        raise ValueError(f"the token of an endpoint lacks topic, type, hash or QoS: {token!r}")
    topic, type_name, hash_text = (_demangle(part) for part in parts[9:12])
    return replace(node, topic=topic, type_name=type_name, type_hash=hash_text, qos=read_qos(parts[12]))


def data_key(domain_id: int, topic: str, type_name: str) -> str:
    """Key on which a topic's messages travel.

    Args:
        domain_id: ROS 2 domain.
        topic: fully qualified topic.
        type_name: ROS 2 type.
    """
    return f"{domain_id}/{topic.strip('/')}/{dds_type_name(type_name)}/{type_hash(type_name)}"
