"""The configuration reference: every message, field and enum value of the schema."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from joshua.schema import config_pb2
from joshua.schema.comments import comment
from joshua.schema.descriptors import is_repeated
from joshua.schema.rules import FIRST_EXTENSION_NUMBER
from joshua.textproto.field_facts import FieldFacts, field_facts

from reference.markdown import EXTENSION, anchor, code, table

HEAD = f"""# Configuration reference

Every block and field of a configuration file. `joshua explain FIELD` prints the same in a terminal.
{EXTENSION} marks what goes beyond the specification: blocks, fields and values that another program
for these files may not know.

A field in **bold** is required. Ranges include their ends unless they say «above».
"""

# Enums with a page of their own.
ELSEWHERE = {"joshua.DataType": "data-types.md"}

_SCALARS = {
    1: "number",
    2: "number",
    3: "integer",
    4: "integer",
    5: "integer",
    8: "true or false",
    9: "text",
    13: "integer",
}

# The specification names this block and leaves its fields open, so all of them are extensions.
_OPEN = "joshua.Calibration"


def configuration_page() -> str:
    """Makes the page."""
    root = config_pb2.Config.DESCRIPTOR
    messages = list(reachable(root))
    places = places_of(root)
    specified = {message.full_name for message in reachable(root, extensions=False)}
    lines = [HEAD]
    for message in messages:
        extension = message.full_name not in specified
        lines += message_section(message, places[message.full_name], extension=extension)
    lines += ["# Values", ""]
    for enum in enums_of(messages):
        if enum.full_name not in ELSEWHERE:
            lines += enum_section(enum)
    return "\n".join(lines)


def reachable(root: Any, *, extensions: bool = True) -> Iterator[Any]:
    """Yields the message types of a file, parents before children, each once.

    Args:
        extensions: go through fields that are extensions, too.
    """
    seen: set[str] = set()

    def walk(message: Any) -> Iterator[Any]:
        if message.full_name in seen or not message.full_name.startswith("joshua."):
            return
        seen.add(message.full_name)
        yield message
        for field in message.fields:
            if field.message_type is not None and (extensions or not is_extension(field)):
                yield from walk(field.message_type)

    return walk(root)


def places_of(root: Any) -> dict[str, list[str]]:
    """Lists the field paths at which each message type stands."""
    places: dict[str, list[str]] = {}

    def walk(message: Any, path: str) -> None:
        places.setdefault(message.full_name, []).append(path)
        for field in message.fields:
            inner = field.message_type
            if inner is not None and inner.full_name.startswith("joshua."):
                index = "[]" if is_repeated(field) else ""
                walk(inner, f"{path}.{field.name}{index}" if path else f"{field.name}{index}")

    walk(root, "")
    return places


def enums_of(messages: list[Any]) -> list[Any]:
    """Lists the enums that the fields of messages use, in the order of their use."""
    found = {
        field.enum_type.full_name: field.enum_type
        for message in messages
        for field in message.fields
        if field.enum_type is not None
    }
    return list(found.values())


def message_section(message: Any, places: list[str], *, extension: bool) -> list[str]:
    """Makes the section of one message: what it is, where it stands, and its fields."""
    mark = f" {EXTENSION}" if extension else ""
    lines = [f"## {message.name}{mark} {{ #{anchor(message.full_name)} }}", "", comment(message), ""]
    shown = [code(place) for place in places[:4]]
    if len(places) > len(shown):
        shown.append(f"{len(places) - len(shown)} more")
    lines += [f"Stands at {', '.join(shown)}.", ""] if any(places) else ["The whole file.", ""]
    rows = [
        field_row(field, facts) for field, facts in zip(message.fields, field_facts(message), strict=True)
    ]
    return lines + table(("Field", "Type", "Meaning", "Allowed", "Default or example"), rows)


def field_row(field: Any, facts: FieldFacts) -> tuple[str, ...]:
    """Makes the row of one field."""
    name = f"**`{field.name}`**" if facts.required else code(field.name)
    if is_extension(field):
        name += f" {EXTENSION}"
    meaning = comment(field)
    if field.containing_oneof is not None and is_choice(field):
        others = [other.name for other in field.containing_oneof.fields if other is not field]
        meaning += f" One of {len(others) + 1}: excludes the other blocks of `{field.containing_oneof.name}`."
    if facts.required_unless:
        meaning += f" Not required beside {' or '.join(code(name) for name in facts.required_unless)}."
    return name, type_text(field), meaning, allowed_text(facts), default_text(facts)


def is_choice(field: Any) -> bool:
    """Whether a field is a member of a real oneof, not of the one that marks an optional scalar."""
    return len(field.containing_oneof.fields) > 1


def is_extension(field: Any) -> bool:
    """Whether a field goes beyond the specification, which its number tells."""
    return bool(field.number >= FIRST_EXTENSION_NUMBER or field.containing_type.full_name == _OPEN)


def type_text(field: Any) -> str:
    """Names the type of a field, with a link where it has a section of its own."""
    if field.message_type is not None:
        name = field.message_type.full_name
        text = (
            f"[{field.message_type.name}](#{anchor(name)})" if name.startswith("joshua.") else "any message"
        )
    elif field.enum_type is not None:
        page = ELSEWHERE.get(field.enum_type.full_name, f"#{anchor(field.enum_type.full_name)}")
        text = f"[{field.enum_type.name}]({page})"
    else:
        text = _SCALARS[field.type]
    return f"list of {text}" if is_repeated(field) else text


def allowed_text(facts: FieldFacts) -> str:
    """Words the range, the unit and the fixed values of a field."""
    parts = [facts.range_text()]
    if not parts[0] and facts.unit:
        parts = [f"in {facts.unit}"]
    if facts.allowed:
        parts.append(", ".join(code(f'"{value}"') for value in facts.allowed))
    if facts.max_items is not None or facts.min_items:
        low, high = facts.min_items, facts.max_items
        parts.append(f"{low} to {high} entries" if high is not None else f"at least {low} entries")
    return "; ".join(part for part in parts if part)


def default_text(facts: FieldFacts) -> str:
    """Words the default of a field; an example where it has none."""
    if facts.default:
        return f"{code(facts.default)} {facts.unit}".strip() if facts.is_number else code(facts.default)
    return f"such as {code(facts.example)}" if facts.example else ""


def enum_section(enum: Any) -> list[str]:
    """Makes the section of one enum."""
    rows = [
        (
            code(value.name) + (f" {EXTENSION}" if value.number >= FIRST_EXTENSION_NUMBER else ""),
            str(value.number),
            comment(value),
        )
        for value in enum.values
        if not value.name.endswith("_UNSPECIFIED")
    ]
    head = [f"## {enum.name} {{ #{anchor(enum.full_name)} }}", "", comment(enum), ""]
    return head + table(("Value", "Number", "Meaning"), rows)
