"""Type names, and the message definitions of the selected ROS 2 distribution, loaded on first use."""

from __future__ import annotations

import difflib
import os
import re
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.messages.cdr_store import CdrStore

HASH_UNSUPPORTED = "TypeHashNotSupported"
"""Written by Humble's middleware in place of a type hash."""

_ROS = re.compile(r"^([a-z][a-z0-9_]*)/(?:(msg|srv|action)/)?([A-Z][A-Za-z0-9_]*)$")
_DDS = re.compile(r"^([a-z][a-z0-9_]*)::(msg|srv|action)::dds_::([A-Z][A-Za-z0-9_]*)_$")
_selected = ""


class MessageError(ValueError):
    """A type is unknown, a field of a message is invalid, or a payload is malformed."""


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
    """The ROS 2 form of any DDS type name, including services and actions, for lists."""
    return wire_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def distro() -> str:
    """The ROS 2 distribution whose definitions this process uses.

    The value of ``ROS_DISTRO`` at the first use, else ``jazzy``. ``select_distro`` overrides it.
    """
    if not _selected:
        select_distro(os.environ.get("ROS_DISTRO", ""))
    return _selected


def select_distro(name: str) -> None:
    """Set the distribution of this process. Existing messages belong to the previous one."""
    global _selected
    _selected = name.strip().lower() or "jazzy"


@cache  # services are added to the loaded types
def _load(humble: bool, octets: tuple[str, ...] = ()) -> CdrStore:
    """Load definitions in which the fields of the types ``octets`` are uint8."""
    # rosbags and numpy take about 0.1 s to import, so they are imported when a message is needed
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
    """The definitions as ROS 2 writes them: Humble's, Jazzy's or those of the selected distribution.

    Every later distribution agrees with Jazzy for all types of the DataType enum.
    """
    return _load(distro() == "humble" if humble is None else humble)


def typestore() -> CdrStore:
    """The selected definitions for encoding: ``byte`` and ``char`` are unsigned octets."""
    return _load(distro() == "humble", ("byte", "char"))


def known_types() -> list[str]:
    """All message type names of the selected distribution, sorted."""
    return sorted(name for name in typestore().fielddefs if "/msg/" in name)


def require_type(name: str) -> str:
    """Normalise a type name and check that its definition is known.

    Raises:
        MessageError: the name is malformed or unknown. The message lists the nearest names.
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
    """Reload the services at their next use, because some were added."""
    _add_services.cache_clear()


def message_class(type_name: str) -> Any:
    """The class of a message type: a dataclass whose fields are those of the ROS 2 definition.

    Its constructor takes them by position or name. Missing fields get the zero of their type.

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
    # ROS 2 describes char as uint8 (type id 3), as rosidl's IDL maps it. rosbags gives it a separate id.
    return _load(False, ("char",)).hash_rihs01(full_name)


def type_hash(type_name: str) -> str:
    """RIHS01 hash of a type, or ``TypeHashNotSupported`` for Humble, which does not send one.

    Raises:
        MessageError: the type is unknown.
    """
    full = require_type(type_name)
    return HASH_UNSUPPORTED if distro() == "humble" else _hash(full)
