"""Facts for binding the fields of a message type, read once from its descriptor."""

from __future__ import annotations

from enum import Enum
from functools import cache
from typing import Any

from google.protobuf.descriptor import FieldDescriptor

from joshua.schema.descriptors import is_repeated

ANY = "google.protobuf.Any"


class Kind(Enum):
    """Kinds of values, by the way they are read."""

    INTEGER = "integer"
    FLOAT = "number"
    BOOL = "bool"
    STRING = "string"
    BYTES = "bytes"
    ENUM = "enum"
    MESSAGE = "message"


_TYPES = {
    FieldDescriptor.CPPTYPE_INT32: (Kind.INTEGER, "whole number"),
    FieldDescriptor.CPPTYPE_UINT32: (Kind.INTEGER, "whole number"),
    FieldDescriptor.CPPTYPE_INT64: (Kind.INTEGER, "whole number"),
    FieldDescriptor.CPPTYPE_UINT64: (Kind.INTEGER, "whole number"),
    FieldDescriptor.CPPTYPE_FLOAT: (Kind.FLOAT, "number"),
    FieldDescriptor.CPPTYPE_DOUBLE: (Kind.FLOAT, "number"),
    FieldDescriptor.CPPTYPE_BOOL: (Kind.BOOL, "true or false"),
    FieldDescriptor.CPPTYPE_STRING: (Kind.STRING, "string in double quotes"),
    FieldDescriptor.CPPTYPE_MESSAGE: (Kind.MESSAGE, "block"),
}
_RANGES = {
    FieldDescriptor.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
    FieldDescriptor.CPPTYPE_UINT32: (0, 2**32 - 1),
    FieldDescriptor.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
    FieldDescriptor.CPPTYPE_UINT64: (0, 2**64 - 1),
}


class FieldInfo:
    """The facts of one field.

    Attributes:
        smallest, largest: range of an integer field.
        type_text: its type in words, such as ``whole number`` or ``name of OperationMode``.
        oneof: name of the oneof that it belongs to; "" for none, and for proto3 ``optional``.
        message, enum: descriptor of its type; None for others.
        is_any: whether it contains a block of a plugin's type; descriptor: of the field itself.
    """

    def __init__(self, field: Any) -> None:
        self.name: str = field.name
        self.message = field.message_type
        self.enum = field.enum_type
        if self.enum is not None:
            self.kind, self.type_text = Kind.ENUM, f"name of {self.enum.name}"
        else:
            self.kind, self.type_text = _TYPES[field.cpp_type]
        if field.type == FieldDescriptor.TYPE_BYTES:
            self.kind = Kind.BYTES
        self.is_repeated: bool = is_repeated(field)
        self.is_map = self.message is not None and bool(self.message.GetOptions().map_entry)
        self.is_any = self.message is not None and bool(self.message.full_name == ANY)
        self.smallest, self.largest = _RANGES.get(field.cpp_type, (0, 0))
        oneof = field.containing_oneof
        # proto3 optional is a oneof with one member in the descriptor.
        self.oneof: str = oneof.name if oneof is not None and len(oneof.fields) > 1 else ""
        self.descriptor = field


@cache
def field_table(descriptor: Any) -> dict[str, FieldInfo]:
    """Return the fields of a message type by the names allowed in a text."""
    table = {}
    for field in descriptor.fields:
        info = table[field.name] = FieldInfo(field)
        # Groups of proto2 are written with the name of their type.
        if field.type == FieldDescriptor.TYPE_GROUP:
            table[field.message_type.name] = info
    return table
