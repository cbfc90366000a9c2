"""Facts of the schema about each field: type, presence and its machine-readable rule.

Checks, `joshua explain` and the reference read the custom field option only here.
"""

from __future__ import annotations

import posixpath
import re
from functools import cache
from typing import Any

from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor

from joshua.schema import options_pb2, rules

_FLOATS = (FieldDescriptor.CPPTYPE_FLOAT, FieldDescriptor.CPPTYPE_DOUBLE)
_NUMBERS = frozenset(
    (
        *_FLOATS,
        *(getattr(FieldDescriptor, f"CPPTYPE_{name}") for name in ("INT32", "INT64", "UINT32", "UINT64")),
    )
)


class FieldFacts:
    """The facts of one field.

    Attributes:
        kind: kind of its value, a ``KIND_…`` number; message_type, enum: descriptor of its type, if any.
        unit, example, default: texts of the rule; minimum, maximum, above: bounds, None if open.
        required, …: further parts of the rule, with the same names.
    """

    def __init__(self, field: FieldDescriptor) -> None:
        rule = rules.rule(field)
        self.name: str = field.name
        self.kind: int = rule.kind
        self.repeated: bool = field.is_repeated
        self.has_presence: bool = field.has_presence
        self.is_number = field.cpp_type in _NUMBERS
        self.is_float = field.cpp_type in _FLOATS
        self.is_string = field.cpp_type == FieldDescriptor.CPPTYPE_STRING
        self.message_type: Any = field.message_type
        self.enum: EnumDescriptor | None = field.enum_type
        self.unit = rule.unit
        self.example = rule.example
        self.default = rule.default
        self.minimum = rule.min if rule.HasField("min") else None
        self.maximum = rule.max if rule.HasField("max") else None
        self.above = rule.above if rule.HasField("above") else None
        self.required = rule.required
        self.required_unless = tuple(rule.required_unless)
        self.may_repeat = rule.may_repeat
        self.allowed = tuple(rule.allowed)
        self.min_items = rule.min_items
        self.max_items = rule.max_items if rule.HasField("max_items") else None
        self.forms = tuple(rule.forms)
        self.overridden_by = rule.overridden_by.field
        self.overridden_because = rule.overridden_by.because
        self.needs_published = rule.needs_published
        self.needs_torque = rule.needs_torque
        self.only_with = rule.only_with if rule.HasField("only_with") else None

    @property
    def is_message(self) -> bool:
        """Whether the field contains blocks."""
        return self.message_type is not None

    def contains(self, value: float) -> bool:
        """Whether a number lies in the allowed range; NaN never does."""
        return (
            (self.minimum is None or value >= self.minimum)
            and (self.maximum is None or value <= self.maximum)
            and (self.above is None or value > self.above)
            and value == value
        )

    def range_text(self) -> str:
        """The allowed range in words, such as ``above 0, at most 10000 Hz``; "" if it is open."""
        parts = []
        if self.above is not None:
            parts.append(f"above {number_text(self.above)}")
        if self.minimum is not None and self.maximum is not None:
            parts.append(f"{number_text(self.minimum)} to {number_text(self.maximum)}")
        elif self.minimum is not None:
            parts.append(f"at least {number_text(self.minimum)}")
        elif self.maximum is not None:
            parts.append(f"at most {number_text(self.maximum)}")
        unit = self.unit if parts else ""
        if unit[:1].isdigit():
            unit = f"(unit: {unit})"
        return f"{', '.join(parts)} {unit}".rstrip()

    def named_by(self, value: str) -> tuple[int, str]:
        """The kind of name of a value, a ``NAMES_…`` number, and the canonical spelling of a device.

        The spelling is "" if any number of readers may use it.
        """
        for form in self.forms:
            texts = (value, posixpath.normpath(value)) if form.names == options_pb2.NAMES_DEVICE else (value,)
            for text in texts:
                if match := re.fullmatch(form.pattern, text, re.DOTALL):
                    return form.names, match.expand(form.identity)
        return options_pb2.NAMES_FILE, ""

    def sample(self) -> str:
        """The field with a typical value, as in a file."""
        if self.message_type is not None:
            inner = [facts for facts in field_facts(self.message_type) if facts.required]
            return f"{self.name} {{ {' '.join(facts.sample() for facts in inner) or '...'} }}"
        if not self.example and self.enum is not None:
            return f"{self.name}: {self.value_names()[0]}"
        return f"{self.name}: {self.example or '...'}"

    def value_names(self) -> tuple[str, ...]:
        """Names of an enum field's values, without the one that means "not chosen"."""
        values = self.enum.values if self.enum is not None else ()
        return tuple(
            value.name for value in values if not (value.number == 0 and value.name.endswith("_UNSPECIFIED"))
        )


def number_text(value: float) -> str:
    """Format a number without unnecessary digits: ``10000``, ``0.1``, ``nan``."""
    number = float(value)
    if number.is_integer() and abs(number) < 1e15:
        return str(int(number))
    return f"{number:.7g}"


@cache
def field_facts(descriptor: Any) -> tuple[FieldFacts, ...]:
    """Return the facts of all fields of a message type (a ``Descriptor``), in the order of the schema."""
    return tuple(FieldFacts(field) for field in descriptor.fields)


def facts_of(field: Any) -> FieldFacts:
    """Return the facts of one field (a ``FieldDescriptor``)."""
    return next(facts for facts in field_facts(field.containing_type) if facts.name == field.name)
