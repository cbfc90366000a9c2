"""The message definitions of the ROS 2 distribution in force, loaded on first use."""

from __future__ import annotations

import difflib
import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from joshua.messages.errors import MessageError
from joshua.messages.names import ros_type_name

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

HASH_UNSUPPORTED = "TypeHashNotSupported"
"""What Humble's middleware writes in place of a type hash."""

_selected = ""


def distro() -> str:
    """ROS 2 distribution whose definitions hold in this process.

    It is ``ROS_DISTRO`` as it stood at the first use, else ``jazzy``; ``select_distro`` overrides it.
    """
    if not _selected:
        select_distro(os.environ.get("ROS_DISTRO", ""))
    return _selected


def select_distro(name: str) -> None:
    """Sets the distribution of this process; messages made before belong to the former one."""
    global _selected
    _selected = name.strip().lower() or "jazzy"


@lru_cache(maxsize=4)
def _load(humble: bool, octets: tuple[str, ...] = ()) -> Typestore:
    """Loads definitions in which the fields of the types ``octets`` are uint8."""
    # rosbags and numpy cost about 0.1 s, so that nothing imports them before a message is needed
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if humble else Stores.ROS2_JAZZY)

    def renamed(described: Any) -> Any:
        kind, rest = described
        if isinstance(rest[0], tuple):  # an array or a sequence of something
            return kind, (renamed(rest[0]), *rest[1:])
        return (kind, ("uint8", *rest[1:])) if rest[0] in octets else described

    for name, (constants, members) in store.fielddefs.items() if octets else ():
        store.fielddefs[name] = constants, [(member, renamed(described)) for member, described in members]
    return store


def definitions() -> Typestore:
    """The definitions in force, as ROS 2 writes them.

    Humble has its own; those of every later distribution agree with Jazzy's for all types of the
    DataType enum.
    """
    return _load(distro() == "humble")


def typestore() -> Typestore:
    """The definitions in force for encoding: ``byte`` and ``char`` are unsigned octets."""
    return _load(distro() == "humble", ("byte", "char"))


def known_types() -> list[str]:
    """All message type names of the distribution in force, sorted."""
    return sorted(name for name in typestore().fielddefs if "/msg/" in name)


def require_type(name: str) -> str:
    """Normalises a type name and checks that its definition is known.

    Raises:
        MessageError: the name is malformed or unknown; the nearest names stand in the message.
    """
    full = ros_type_name(name)
    if full not in typestore().fielddefs:
        near = difflib.get_close_matches(full, known_types(), n=3, cutoff=0.5)
        hint = f"; the nearest are {', '.join(near)}" if near else ""
        raise MessageError(f"the message type {full} is not known to ROS 2 {distro()}{hint}")
    return full


def message_class(type_name: str) -> Any:
    """The class of a message type: a dataclass whose fields are those of the ROS 2 definition.

    Raises:
        MessageError: the type is unknown.
    """
    return typestore().types[require_type(type_name)]


@lru_cache(maxsize=512)
def _hash(full_name: str) -> str:
    # ROS 2 describes char as uint8 (type id 3), as rosidl's IDL maps it; rosbags gives it an id of its own.
    return _load(False, ("char",)).hash_rihs01(full_name)


def type_hash(type_name: str) -> str:
    """RIHS01 hash of a type, or ``TypeHashNotSupported`` for Humble, whose wire carries none.

    Raises:
        MessageError: the type is unknown.
    """
    full = require_type(type_name)
    return HASH_UNSUPPORTED if distro() == "humble" else _hash(full)
