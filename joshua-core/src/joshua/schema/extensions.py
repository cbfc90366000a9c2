"""Distinguishes parts of the schema defined by the specification from extensions."""

from __future__ import annotations

from functools import cache
from typing import Any

from joshua.schema import config_pb2
from joshua.schema.rules import FIRST_EXTENSION_NUMBER

_PACKAGE = "joshua"
_FIRST_EXTENSION_DATA_TYPE = 1000
# The specification names this block but does not define its fields.
_OPEN_MESSAGES = frozenset(("joshua.Calibration",))


def is_extension(descriptor: Any) -> bool:
    """Whether a field or enum value of the core's schema is an extension of the specification.

    Args:
        descriptor: FieldDescriptor or EnumValueDescriptor. Those of plugins are no extensions.
    """
    specified_messages, specified_enums = _specified()
    message = getattr(descriptor, "containing_type", None)
    if message is not None:
        if message.file.package != _PACKAGE:
            return False
        fixed = message.full_name in specified_messages and message.full_name not in _OPEN_MESSAGES
        return not fixed or bool(descriptor.number >= FIRST_EXTENSION_NUMBER)
    enum = descriptor.type
    if enum.file.package != _PACKAGE:
        return False
    first = _FIRST_EXTENSION_DATA_TYPE if enum.name == "DataType" else FIRST_EXTENSION_NUMBER
    return enum.full_name not in specified_enums or bool(descriptor.number >= first)


@cache
def _specified() -> tuple[frozenset[str], frozenset[str]]:
    """Full names of the messages and enums that specified fields alone reach."""
    messages: set[str] = set()
    enums: set[str] = set()
    waiting: list[Any] = [config_pb2.Config.DESCRIPTOR]
    while waiting:
        message = waiting.pop()
        if message.full_name in messages:
            continue
        messages.add(message.full_name)
        if message.full_name in _OPEN_MESSAGES:
            continue
        for field in message.fields:
            if field.number >= FIRST_EXTENSION_NUMBER:
                continue
            if field.message_type is not None:
                waiting.append(field.message_type)
            elif field.enum_type is not None:
                enums.add(field.enum_type.full_name)
    return frozenset(messages), frozenset(enums)
