"""Type names, and the message definitions of the ROS 2 distribution in force, loaded on first use."""

from __future__ import annotations

import difflib
import os
import re
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.messages.cdr_store import CdrStore

HASH_UNSUPPORTED = "TypeHashNotSupported"
"""What Humble's middleware writes in place of a type hash."""

_ROS = re.compile(r"^([a-z][a-z0-9_]*)/(?:(msg|srv|action)/)?([A-Z][A-Za-z0-9_]*)$")
_DDS = re.compile(r"^([a-z][a-z0-9_]*)::(msg|srv|action)::dds_::([A-Z][A-Za-z0-9_]*)_$")
_selected = ""


class MessageError(ValueError):
    """A type is unknown, a message has a field that does not fit, or a payload is malformed."""


def ros_type_name(name: str) -> str:
    """Normalise ``pkg/msg/Type``, ``pkg/Type`` or ``pkg::msg::dds_::Type_`` to the first form.

    Raises:
        MessageError: the name has none of these forms.
    """
    match = _ROS.match(name) or _DDS.match(name)
    if match is None:
        raise MessageError(
            f"{name!r} is not a message type name; write it as package/msg/Type, "
            "such as sensor_msgs/msg/JointState"
        )
    return f"{match[1]}/{match[2] or 'msg'}/{match[3]}"


def dds_type_name(name: str) -> str:
    """Name of a type on the wire, such as ``std_msgs::msg::dds_::String_``.

    Raises:
        MessageError: the name is not a message type name.
    """
    package, kind, base = ros_type_name(name).split("/")
    return f"{package}::{kind}::dds_::{base}_"


def shown_type_name(wire_name: str) -> str:
    """The ROS 2 form of any DDS type name, for lists; services and actions included."""
    return wire_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def distro() -> str:
    """ROS 2 distribution whose definitions hold in this process.

    It is ``ROS_DISTRO`` as it stood at the first use, else ``jazzy``; ``select_distro`` overrides it.
    """
    if not _selected:
        select_distro(os.environ.get("ROS_DISTRO", ""))
    return _selected


def select_distro(name: str) -> None:
    """Set the distribution of this process; messages made before belong to the former one."""
    global _selected
    _selected = name.strip().lower() or "jazzy"


@cache  # services are added to what is loaded
def _load(humble: bool, octets: tuple[str, ...] = ()) -> CdrStore:
    """Load definitions in which the fields of the types ``octets`` are uint8."""
    # rosbags and numpy cost about 0.1 s, so that nothing imports them before a message is needed
    from joshua.messages.cdr_store import CdrStore

    store = CdrStore("ros2_humble" if humble else "ros2_jazzy")

    def renamed(described: Any) -> Any:
        kind, rest = described
        if isinstance(rest[0], tuple):  # an array or a sequence of something
            return kind, (renamed(rest[0]), *rest[1:])
        return (kind, ("uint8", *rest[1:])) if rest[0] in octets else described

    for name, (constants, members) in store.fielddefs.items() if octets else ():
        store.fielddefs[name] = constants, [(member, renamed(described)) for member, described in members]
    return store


def definitions(humble: bool | None = None) -> CdrStore:
    """The definitions as ROS 2 writes them: those in force, or Humble's or Jazzy's.

    Those of every later distribution agree with Jazzy's for all types of the DataType enum.
    """
    return _load(distro() == "humble" if humble is None else humble)


def typestore() -> CdrStore:
    """The definitions in force for encoding: ``byte`` and ``char`` are unsigned octets."""
    return _load(distro() == "humble", ("byte", "char"))


def known_types() -> list[str]:
    """All message type names of the distribution in force, sorted."""
    return sorted(name for name in typestore().fielddefs if "/msg/" in name)


def require_type(name: str) -> str:
    """Normalise a type name and check that its definition is known.

    Raises:
        MessageError: the name is malformed or unknown; the nearest names stand in the message.
    """
    full = ros_type_name(name)
    if "/msg/" not in full:
        _add_services(distro() == "humble")
    if full not in typestore().fielddefs:
        near = difflib.get_close_matches(full, known_types(), n=3, cutoff=0.5)
        hint = f"; the nearest are {', '.join(near)}" if near else ""
        raise MessageError(f"the message type {full} is not known to ROS 2 {distro()}{hint}")
    return full


@lru_cache(maxsize=2)
def _add_services(humble: bool) -> None:
    from joshua.messages.services import service_definitions

    messages, others = service_definitions()
    store = _load(humble, ("byte", "char"))
    store.register({name: fields for name, fields in messages.items() if name not in store.types})
    for store in (_load(humble), _load(humble, ("byte", "char")), _load(False, ("char",))):
        store.fielddefs.update(messages)
        store.fielddefs.update(others)


def forget_services() -> None:
    """Load services anew at their next use: there are further ones."""
    _add_services.cache_clear()


def message_class(type_name: str) -> Any:
    """The class of a message type: a dataclass whose fields are those of the ROS 2 definition.

    Its constructor takes them in order or by name; what is left out takes the zero of its type.

    Raises:
        MessageError: the type is unknown.
    """
    return _class(type_name, distro())


@lru_cache(maxsize=512)
def _class(type_name: str, _distro: str) -> Any:
    from joshua.messages.fields import give_defaults

    full = require_type(type_name)
    made = typestore().class_of(full)
    give_defaults(made, full)
    return made


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
