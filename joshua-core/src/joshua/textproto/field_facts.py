"""What the schema says about each field: type, presence and the machine-readable rule beside it.

The one place where checks, `joshua explain` and the reference read the custom field option from.
"""

from __future__ import annotations

import posixpath
import re
from typing import Any, NamedTuple

from google.protobuf.descriptor import EnumDescriptor, FieldDescriptor

from joshua.schema import options_pb2, rules

_NUMBERS = frozenset(
    (
        FieldDescriptor.CPPTYPE_INT32,
        FieldDescriptor.CPPTYPE_INT64,
        FieldDescriptor.CPPTYPE_UINT32,
        FieldDescriptor.CPPTYPE_UINT64,
        FieldDescriptor.CPPTYPE_FLOAT,
        FieldDescriptor.CPPTYPE_DOUBLE,
    )
)


class FieldFacts(NamedTuple):
    """The facts of one field.

    Attributes:
        name: of the field; kind: what its value names, a ``KIND_…`` number.
        repeated, has_presence, is_number, is_float, is_string: of its type.
        message_type: descriptor of the message type; None for scalars.
        enum: descriptor of the enum type, if it is one.
        unit, example, default: texts of the rule; minimum, maximum, above: bounds, None where open.
        required, required_unless, allowed, may_repeat, min_items, max_items, forms, overridden_by,
            overridden_because, needs_published: further parts of the rule.
    """

    name: str
    kind: int
    repeated: bool
    has_presence: bool
    is_number: bool
    is_float: bool
    is_string: bool
    message_type: Any
    enum: EnumDescriptor | None
    unit: str
    example: str
    default: str
    minimum: float | None
    maximum: float | None
    above: float | None
    required: bool
    required_unless: tuple[str, ...]
    may_repeat: bool
    allowed: tuple[str, ...]
    min_items: int
    max_items: int | None
    forms: tuple[Any, ...]
    overridden_by: str
    overridden_because: str
    needs_published: str

    @property
    def is_message(self) -> bool:
        """Whether the field holds blocks."""
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
        """The allowed range in words, such as ``above 0, at most 10000 Hz``; "" where it is open."""
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
        """What a value names by its spelling, a ``NAMES_…`` number, and a device by one spelling of all.

        That spelling is "" for what any number of readers may use.
        """
        for form in self.forms:
            texts = (value, posixpath.normpath(value)) if form.names == options_pb2.NAMES_DEVICE else (value,)
            for text in texts:
                if match := re.fullmatch(form.pattern, text, re.DOTALL):
                    return form.names, match.expand(form.identity)
        return options_pb2.NAMES_FILE, ""

    def sample(self) -> str:
        """The field with a typical value, as it may stand in a file."""
        if self.message_type is not None:
            inner = [facts for facts in field_facts(self.message_type) if facts.required]
            return f"{self.name} {{ {' '.join(facts.sample() for facts in inner) or '...'} }}"
        if not self.example and self.enum is not None:
            return f"{self.name}: {self.value_names()[0]}"
        return f"{self.name}: {self.example or '...'}"

    def value_names(self) -> tuple[str, ...]:
        """Names of an enum field's values, without the one that stands for «not chosen»."""
        values = self.enum.values if self.enum is not None else ()
        return tuple(
            value.name for value in values if not (value.number == 0 and value.name.endswith("_UNSPECIFIED"))
        )


def number_text(value: float) -> str:
    """Writes a number without needless digits: ``10000``, ``0.1``, ``nan``."""
    number = float(value)
    if number.is_integer() and abs(number) < 1e15:
        return str(int(number))
    return f"{number:.7g}"


_facts: dict[Any, tuple[FieldFacts, ...]] = {}


def facts_of(field: Any) -> FieldFacts:
    """Returns the facts of one field (a ``FieldDescriptor``)."""
    return next(facts for facts in field_facts(field.containing_type) if facts.name == field.name)


def field_facts(descriptor: Any) -> tuple[FieldFacts, ...]:
    """Returns the facts of all fields of a message type (a ``Descriptor``), in the order of the schema."""
    known = _facts.get(descriptor)
    if known is None:
        known = _facts[descriptor] = tuple(_read(field) for field in descriptor.fields)
    return known


def _read(field: FieldDescriptor) -> FieldFacts:
    rule = rules.rule(field)
    return FieldFacts(
        name=field.name,
        kind=rule.kind,
        repeated=field.is_repeated,
        has_presence=field.has_presence,
        is_number=field.cpp_type in _NUMBERS,
        is_float=field.cpp_type in (FieldDescriptor.CPPTYPE_FLOAT, FieldDescriptor.CPPTYPE_DOUBLE),
        is_string=field.cpp_type == FieldDescriptor.CPPTYPE_STRING,
        message_type=field.message_type,
        enum=field.enum_type,
        unit=rule.unit,
        example=rule.example,
        default=rule.default,
        minimum=rule.min if rule.HasField("min") else None,
        maximum=rule.max if rule.HasField("max") else None,
        above=rule.above if rule.HasField("above") else None,
        required=rule.required,
        required_unless=tuple(rule.required_unless),
        may_repeat=rule.may_repeat,
        allowed=tuple(rule.allowed),
        min_items=rule.min_items,
        max_items=rule.max_items if rule.HasField("max_items") else None,
        forms=tuple(rule.forms),
        overridden_by=rule.overridden_by.field,
        overridden_because=rule.overridden_by.because,
        needs_published=rule.needs_published,
    )
