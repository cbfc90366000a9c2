"""What binding must know about the fields of a message type, read from its descriptor once."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

from google.protobuf.descriptor import FieldDescriptor

ANY = "google.protobuf.Any"


class Kind(Enum):
    """The kinds of values that are read differently."""

    INTEGER = "integer"
    FLOAT = "number"
    BOOL = "bool"
    STRING = "string"
    BYTES = "bytes"
    ENUM = "enum"
    MESSAGE = "message"


class FieldInfo(NamedTuple):
    """The facts of one field.

    Attributes:
        smallest, largest: range of an integer field.
        type_text: its type in words, such as ``whole number`` or ``one of the OperationMode names``.
        oneof: name of the oneof that it belongs to; "" for none, and for proto3 ``optional``.
        message, enum: descriptor of its type; None for others.
        descriptor: of the field itself.
    """

    name: str
    kind: Kind
    is_repeated: bool
    is_map: bool
    oneof: str
    smallest: int
    largest: int
    type_text: str
    message: Any
    enum: Any
    descriptor: Any

    @property
    def is_any(self) -> bool:
        """Whether the field holds a block of a plugin's own type."""
        return self.message is not None and bool(self.message.full_name == ANY)


_RANGES = {
    FieldDescriptor.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
    FieldDescriptor.CPPTYPE_UINT32: (0, 2**32 - 1),
    FieldDescriptor.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
    FieldDescriptor.CPPTYPE_UINT64: (0, 2**64 - 1),
}
_tables: dict[Any, dict[str, FieldInfo]] = {}


def field_table(descriptor: Any) -> dict[str, FieldInfo]:
    """Returns the fields of a message type by the names that a text may use."""
    table = _tables.get(descriptor)
    if table is None:
        table = {}
        for field in descriptor.fields:
            info = _info(field)
            table[info.name] = info
            # Groups of proto2 are written by the name of their type.
            if field.type == FieldDescriptor.TYPE_GROUP:
                table[field.message_type.name] = info
        _tables[descriptor] = table
    return table


def _info(field: Any) -> FieldInfo:
    smallest = largest = 0
    message = enum = None
    is_map = False
    cpp_type = field.cpp_type
    if cpp_type == FieldDescriptor.CPPTYPE_MESSAGE:
        kind, message = Kind.MESSAGE, field.message_type
        is_map = bool(message.GetOptions().map_entry)
        type_text = "block"
    elif cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        kind, enum = Kind.ENUM, field.enum_type
        type_text = f"name of {enum.name}"
    elif cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        kind, type_text = Kind.BOOL, "true or false"
    elif cpp_type == FieldDescriptor.CPPTYPE_STRING:
        kind = Kind.BYTES if field.type == FieldDescriptor.TYPE_BYTES else Kind.STRING
        type_text = "string in double quotes"
    elif cpp_type in _RANGES:
        kind, type_text = Kind.INTEGER, "whole number"
        smallest, largest = _RANGES[cpp_type]
    else:
        kind, type_text = Kind.FLOAT, "number"
    oneof = field.containing_oneof
    # proto3 optional is a oneof of its own in the descriptor, with one member.
    oneof_name = oneof.name if oneof is not None and len(oneof.fields) > 1 else ""
    return FieldInfo(
        field.name,
        kind,
        field.is_repeated,
        is_map,
        oneof_name,
        smallest,
        largest,
        type_text,
        message,
        enum,
        field,
    )
