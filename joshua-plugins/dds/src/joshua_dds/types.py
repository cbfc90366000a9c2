"""DDS types built from the ROS 2 definitions, as discovery compares them field by field."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from cyclonedds import idl
from joshua.messages import dds_type_name, distro
from joshua.messages.fields import Field, fields

# the wheel's types are indexed like generics, which its annotations omit
_types: Any = idl.types

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": _types.uint8,
    "char": _types.uint8,
    "int8": _types.int8,
    "uint8": _types.uint8,
    "int16": _types.int16,
    "uint16": _types.uint16,
    "int32": _types.int32,
    "uint32": _types.uint32,
    "int64": _types.int64,
    "uint64": _types.uint64,
    "float32": _types.float32,
    "float64": _types.float64,
    "string": str,
}


def idl_type(type_name: str) -> Any:
    """Return the DDS type of a ROS 2 type, which serves only discovery; payloads never pass through it.

    Raises:
        MessageError: the type is unknown.
    """
    return _build(type_name, distro())


@lru_cache(maxsize=512)
def _build(type_name: str, name: str) -> Any:
    members = {field.wire_name: _member(field, name) for field in fields(type_name)}
    return idl.make_idl_struct(type_name.rsplit("/", 1)[1] + "_", dds_type_name(type_name), members)


def _member(field: Field, name: str) -> Any:
    inner = _build(field.base, name) if field.is_message else _PRIMITIVES[field.base]
    if field.shape == "array":
        return _types.array[inner, field.length]
    if field.shape == "sequence":
        return _types.sequence[inner, field.length] if field.length else _types.sequence[inner]
    return inner
