"""Topic on which ROS 2 participants announce which node owns which endpoint.

Source: ros2/rmw_dds_common, ParticipantEntitiesInfo. Humble's gids have 24 bytes, later ones 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from cyclonedds import idl

# the wheel's types are indexed like generics, which its annotations omit
_types: Any = idl.types

TOPIC = "ros_discovery_info"
TYPE_NAME = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_GUID_BYTES = 16
_NAME_LENGTH = 256


@dataclass(frozen=True)
class NodeEntry:
    """One node of a participant.

    Attributes:
        namespace: with leading slash; readers, writers: gids of its endpoints, 16 bytes each.
    """

    namespace: str
    name: str
    readers: tuple[bytes, ...]
    writers: tuple[bytes, ...]

    @property
    def full_name(self) -> str:
        """Fully qualified name of the node."""
        return f"{self.namespace.rstrip('/')}/{self.name}"


@lru_cache(maxsize=2)
def info_type(gid_bytes: int) -> Any:
    """Return the DDS type with gids of 16 or, for Humble, 24 bytes."""
    prefix = "rmw_dds_common::msg::dds_::"
    gid = idl.make_idl_struct("Gid_", f"{prefix}Gid_", {"data": _types.array[_types.uint8, gid_bytes]})
    node = idl.make_idl_struct(
        "NodeEntitiesInfo_",
        f"{prefix}NodeEntitiesInfo_",
        {
            "node_namespace": _types.bounded_str[_NAME_LENGTH],
            "node_name": _types.bounded_str[_NAME_LENGTH],
            "reader_gid_seq": _types.sequence[gid],
            "writer_gid_seq": _types.sequence[gid],
        },
    )
    members = {"gid": gid, "node_entities_info_seq": _types.sequence[node]}
    made: Any = idl.make_idl_struct("ParticipantEntitiesInfo_", f"{prefix}ParticipantEntitiesInfo_", members)
    made.gid_type, made.node_type = gid, node
    return made


def pack(kind: Any, participant: bytes, nodes: Sequence[NodeEntry]) -> Any:
    """Make the message of a participant.

    Args:
        kind: what ``info_type`` returned.
        participant: its GUID, 16 bytes.
        nodes: its nodes.
    """
    length = kind.gid_type.__annotations__["data"].__metadata__[0].length

    def gid(raw: bytes) -> Any:
        return kind.gid_type(data=list(raw.ljust(length, b"\x00")))

    return kind(
        gid=gid(participant),
        node_entities_info_seq=[
            kind.node_type(
                node_namespace=node.namespace,
                node_name=node.name,
                reader_gid_seq=[gid(reader) for reader in node.readers],
                writer_gid_seq=[gid(writer) for writer in node.writers],
            )
            for node in nodes
        ],
    )


def unpack(message: Any) -> tuple[bytes, list[NodeEntry]]:
    """Return the participant's GUID and its nodes, without names that are invalid in ROS 2."""

    def guid(gid: Any) -> bytes:
        return bytes(gid.data[:_GUID_BYTES])

    return guid(message.gid), [
        NodeEntry(
            node.node_namespace,
            node.node_name,
            tuple(guid(gid) for gid in node.reader_gid_seq),
            tuple(guid(gid) for gid in node.writer_gid_seq),
        )
        for node in message.node_entities_info_seq
        # names are printed on terminals, and come from any participant of the domain
        if f"{node.node_namespace}{node.node_name}".isprintable()
    ]
