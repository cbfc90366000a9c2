"""The content of a configuration block as plain Python values, with defaults from the rules."""

from __future__ import annotations

import json
import struct
from functools import lru_cache
from typing import Any

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from joshua.schema.descriptors import is_repeated
from joshua.schema.rules import rule

_FLOATS = (FieldDescriptor.CPPTYPE_FLOAT, FieldDescriptor.CPPTYPE_DOUBLE)
_INTEGERS = (
    FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64,
    FieldDescriptor.CPPTYPE_UINT32,
    FieldDescriptor.CPPTYPE_UINT64,
)


@lru_cache(maxsize=256)
def default_values(message_type: Descriptor) -> dict[str, Any]:
    """Defaults of a message's omitted fields by name. Fields without a rule have proto3's zero.

    Raises:
        ValueError: a rule's default does not match the type of its field.
    """
    return {field.name: _default(field) for field in message_type.fields}


def block_values(block: Message) -> dict[str, Any]:
    """Convert a block to plain values: numbers, strings, lists, and dicts for messages.

    Enum values become their names, ``float`` fields their shortest decimal (0.1, not 0.10000000149), an
    omitted message None and an omitted scalar the default of its ``FieldRule``. An omitted ``optional`` field
    without a default is None. A proto3 field without presence counts as omitted if it is 0, as the schema
    defines.
    """
    values = dict(default_values(block.DESCRIPTOR))
    for field, value in block.ListFields():
        if field.is_extension:
            continue
        if is_repeated(field):
            if field.message_type is not None and field.message_type.GetOptions().map_entry:
                values[field.name] = dict(value)
            else:
                values[field.name] = [_plain(field, item) for item in value]
        else:
            values[field.name] = _plain(field, value)
    return values


def _plain(field: FieldDescriptor, value: Any) -> Any:
    if field.cpp_type == FieldDescriptor.CPPTYPE_MESSAGE:
        return block_values(value)
    if field.enum_type is not None:
        known = field.enum_type.values_by_number.get(value)
        return known.name if known else value
    if field.cpp_type == FieldDescriptor.CPPTYPE_FLOAT:
        return shortest_float32(value)
    return value


def _default(field: FieldDescriptor) -> Any:
    text = rule(field).default
    if is_repeated(field):
        return json.loads(text) if text else []
    if field.cpp_type == FieldDescriptor.CPPTYPE_MESSAGE:
        return None
    if not text:
        # an optional field without a default means "unchanged", which no number expresses
        return None if field.has_presence else _plain(field, field.default_value)
    try:
        return _parse(field, text)
    except ValueError as error:
        raise ValueError(
            f"{field.full_name}: the rule's default {text!r} does not match the field"
        ) from error


def _parse(field: FieldDescriptor, text: str) -> Any:
    if field.cpp_type in _INTEGERS:
        return int(text)
    if field.cpp_type in _FLOATS:
        return float(text)
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"
    if field.enum_type is not None:
        if text not in field.enum_type.values_by_name:
            raise ValueError(text)
        return text
    return json.loads(text)


def shortest_float32(value: float) -> float:
    """The shortest decimal that parses to the same 32-bit number."""
    single = struct.Struct("<f")
    wanted = single.pack(value)
    for digits in (6, 7, 8):
        candidate = float(f"{value:.{digits}g}")
        try:
            if single.pack(candidate) == wanted:
                return candidate
        except OverflowError:  # rounding up exceeded the largest 32-bit number
            continue
    return value
