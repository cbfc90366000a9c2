"""The machine-readable facts of the schema: the options ``rule``, ``block`` and ``value`` of its descriptors.

Descriptors are typed ``Any`` here: the stubs give one class for generated modules and another for pools. The
returned messages are shared and must not be changed.
"""

from __future__ import annotations

from typing import Any

from joshua.schema import options_pb2

FIRST_EXTENSION_NUMBER = 100


def rule(field: Any) -> options_pb2.FieldRule:
    """Return the rule of a FieldDescriptor, an empty one if the schema states none."""
    found: options_pb2.FieldRule = field.GetOptions().Extensions[options_pb2.rule]
    return found


def block_rule(message: Any) -> options_pb2.BlockRule:
    """Return the rule of a block by the Descriptor of its message, an empty one if there is none."""
    found: options_pb2.BlockRule = message.GetOptions().Extensions[options_pb2.block]
    return found


def value_rule(enum: Any, number: int) -> options_pb2.ValueRule:
    """Return the rule of an enum value, an empty one if there is none or no such value."""
    value = enum.values_by_number.get(number)
    if value is None:
        return options_pb2.ValueRule()
    found: options_pb2.ValueRule = value.GetOptions().Extensions[options_pb2.value]
    return found
