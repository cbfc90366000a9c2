"""The machine-readable facts of a field: the ``(joshua.rule)`` option of its descriptor.

Descriptors are typed ``Any`` here: the stubs give one class for generated modules and another for pools.
"""

from __future__ import annotations

from typing import Any

from joshua.schema import options_pb2

FIRST_EXTENSION_NUMBER = 100


def rule(field: Any) -> options_pb2.FieldRule:
    """Returns the rule of a FieldDescriptor; an empty one where the schema states none.

    The message is shared and must not be changed.
    """
    found: options_pb2.FieldRule = field.GetOptions().Extensions[options_pb2.rule]
    return found


def has_rule(field: Any) -> bool:
    """Tells whether the schema states a rule for a FieldDescriptor."""
    return bool(field.GetOptions().HasExtension(options_pb2.rule))
