"""The pages of ``joshua explain``, as text."""

from __future__ import annotations

import textwrap
from typing import Any

from joshua.config.codes import CODES
from joshua.config.explain.catalogue import Catalogue, Place
from joshua.schema import options_pb2
from joshua.schema.comments import comment
from joshua.schema.extensions import is_extension
from joshua.textproto.field_facts import field_facts
from joshua.textproto.field_table import ANY, Kind, field_table

_LABEL = 10
_MOST_USERS = 4
_TYPES = {
    Kind.INTEGER: "whole number",
    Kind.FLOAT: "number",
    Kind.BOOL: "true or false",
    Kind.STRING: "string",
    Kind.BYTES: "bytes",
}


def overview(width: int) -> str:
    """Returns the page of the whole file: its blocks, and how to ask further."""
    from joshua.schema.config_pb2 import Config

    lines = ["A configuration file holds these blocks and fields:", ""]
    lines += _children(Config.DESCRIPTOR, width)
    lines += ["", "joshua explain robot.actions          the fields of a block"]
    lines += ["joshua explain general.mode           one field and the values that it takes"]
    lines += ["joshua explain MODE_TEST              one value, message or diagnostic code"]
    return "\n".join(lines) + "\n"


def explain(found: list[Any], catalogue: Catalogue, width: int) -> str:
    """Returns the page of what ``Catalogue.find`` found; a list of places where it is more than one."""
    if len(found) > 1:
        lines = ["This name stands for several fields:", ""]
        lines += _table([(place.path, first_sentence(comment(place.field))) for place in found], width)
        return "\n".join(lines) + "\n"
    item = found[0]
    if isinstance(item, str):
        lines = _code(item, width)
    elif isinstance(item, Place):
        lines = _field(item, catalogue, width)
    elif hasattr(item, "fields_by_name"):
        lines = [_title(item.full_name, "block"), "", *_wrap(comment(item), width), ""]
        lines += _users([place for place in catalogue.places if place.field.message_type is item], width)
        lines += _children(item, width)
    elif hasattr(item, "values_by_name"):
        lines = [_title(item.name, "names of which one is written"), "", *_wrap(comment(item), width), ""]
        lines += _users([place for place in catalogue.places if place.field.enum_type is item], width)
        lines += _values(item, width)
    else:
        lines = _value(item, catalogue, width)
    return "\n".join(lines).rstrip() + "\n"


def first_sentence(text: str) -> str:
    """Returns the first sentence of a comment."""
    head = text.partition("\n")[0]
    end = head.find(". ")
    return head if end == -1 else head[: end + 1]


def _code(code: str, width: int) -> list[str]:
    row = CODES[code]
    return [
        _title(code, "diagnostic"),
        "",
        *_labelled("cause", row.cause, width),
        *_labelled("do", row.next_step, width),
    ]


def _field(place: Place, catalogue: Catalogue, width: int) -> list[str]:
    field = place.field
    lines = [_title(place.path, type_text(field)), "", *_wrap(comment(field), width), ""]
    for label, text in facts(field):
        lines += _labelled(label, text, width)
    if field.enum_type is not None:
        lines += ["", "Values:", *_values(field.enum_type, width)]
    elif field.message_type is not None and field.message_type.full_name == ANY:
        lines += ["", *_plugin_blocks(field, catalogue, width)]
    elif field.message_type is not None:
        lines += ["", *_wrap(comment(field.message_type), width), "", *_children(field.message_type, width)]
    return lines


def facts(field: Any) -> list[tuple[str, str]]:
    """Returns what the rule of a field says, as labels and texts, for people."""
    known = next(item for item in field_facts(field.containing_type) if item.name == field.name)
    found: list[tuple[str, str]] = []
    if known.kind:
        kind = options_pb2.FieldKind.DESCRIPTOR.values_by_number[known.kind]
        found.append(("names", comment(kind).rstrip(".")))
    unit = known.unit
    limits = known.range_text()
    if limits:
        found.append(("range", limits))
    elif unit:
        found.append(("unit", unit))
    if known.allowed:
        found.append(("allowed", ", ".join(f'"{text}"' for text in known.allowed)))
    if known.min_items or known.max_items is not None:
        most = f" to {known.max_items}" if known.max_items is not None else " or more"
        found.append(("entries", f"{known.min_items}{most}"))
    if known.required:
        instead = f", unless {' or '.join(known.required_unless)} is written" if known.required_unless else ""
        found.append(("required", f"yes{instead}"))
    elif known.default:
        found.append(("default", known.default))
    oneof = field.containing_oneof
    if oneof is not None and len(oneof.fields) > 1:
        others = [other.name for other in oneof.fields if other.name != field.name]
        found.append(("excludes", ", ".join(others)))
    if known.example or known.is_message or known.enum is not None:
        found.append(("example", known.sample()))
    found.append(("schema", f"{field.containing_type.full_name}, field {field.number}{_origin(field)}"))
    return found


def type_text(field: Any) -> str:
    """Returns the type of a field in words, such as ``list of whole numbers``."""
    info = field_table(field.containing_type)[field.name]
    if info.kind is Kind.MESSAGE:
        name = "block of a plugin" if info.is_any else "block"
    elif info.kind is Kind.ENUM:
        name = f"name of {info.enum.name}"
    else:
        name = _TYPES[info.kind]
    if not info.is_repeated:
        return name
    return f"{name}, may be repeated" if info.kind is Kind.MESSAGE else f"list: {name} for each entry"


def _plugin_blocks(field: Any, catalogue: Catalogue, width: int) -> list[str]:
    messages = catalogue.plugin_messages
    if not messages:
        return _wrap(
            "No plugin that is installed brings a block of its own; `joshua plugins` lists them.", width
        )
    rows = [(item.full_name, first_sentence(comment(item))) for item in messages]
    sample = f"{field.name} {{ [type.googleapis.com/{messages[0].full_name}] {{ … }} }}"
    return [
        "Types of the plugins that are installed:",
        *_table(rows, width),
        "",
        *_labelled("written", sample, width),
    ]


def _value(value: Any, catalogue: Catalogue, width: int) -> list[str]:
    lines = [_title(value.name, f"value of {value.type.name}"), "", *_wrap(comment(value), width), ""]
    lines += _users([place for place in catalogue.places if place.field.enum_type is value.type], width)
    lines += _labelled("schema", f"{value.type.full_name}, number {value.number}{_origin(value)}", width)
    return lines


def _users(places: list[Place], width: int) -> list[str]:
    """Names the fields of a file that hold a block or an enum."""
    paths = [place.path for place in places]
    more = f" and {len(paths) - _MOST_USERS} more" if len(paths) > _MOST_USERS else ""
    return [*_labelled("used by", ", ".join(paths[:_MOST_USERS]) + more, width), ""] if paths else []


def _children(message: Any, width: int) -> list[str]:
    rows = []
    for field in message.fields:
        known = next(item for item in field_facts(message) if item.name == field.name)
        marks = ["required"] if known.required and not known.required_unless else []
        marks += ["extension"] if is_extension(field) and not _all_extensions(message) else []
        mark = f" [{', '.join(marks)}]" if marks else ""
        rows.append((field.name, f"{first_sentence(comment(field))}{mark}"))
    return _table(rows, width)


def _all_extensions(message: Any) -> bool:
    """Whether a block as a whole is an extension, so that marking each of its fields says nothing."""
    return all(is_extension(field) for field in message.fields)


def _values(enum: Any, width: int) -> list[str]:
    rows = []
    whole = all(is_extension(value) for value in enum.values)
    for value in enum.values:
        if value.number == 0 and value.name.endswith("_UNSPECIFIED"):
            continue
        mark = " [extension]" if is_extension(value) and not whole else ""
        rows.append((value.name, f"{first_sentence(comment(value))}{mark}"))
    return _table(rows, width)


def _origin(descriptor: Any) -> str:
    owner = getattr(descriptor, "containing_type", None) or descriptor.type
    if owner.file.package != "joshua":
        return f" of {owner.file.name}"
    return " (extension)" if is_extension(descriptor) else " (specification)"


def _title(name: str, what: str) -> str:
    return f"{name}: {what}"


def _wrap(text: str, width: int) -> list[str]:
    lines: list[str] = []
    for paragraph in text.split("\n\n"):
        lines += [
            "",
            *textwrap.wrap(
                paragraph, width, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
            ),
        ]
    return lines[1:]


def _labelled(label: str, text: str, width: int) -> list[str]:
    indent = " " * (_LABEL + 2)
    return textwrap.wrap(
        text, width, initial_indent=f"  {label:<{_LABEL}}", subsequent_indent=indent, break_on_hyphens=False
    )


def _table(rows: list[tuple[str, str]], width: int) -> list[str]:
    """Prints two columns; a name that is longer than the column gets a line of its own."""
    column = min(max((len(name) for name, _ in rows), default=0), 32) + 2
    lines: list[str] = []
    for name, text in rows:
        head = f"  {name:<{column}}"
        if len(name) >= column:
            lines.append(f"  {name}")
            head = " " * (column + 2)
        indent = " " * (column + 2)
        lines += textwrap.wrap(
            text, max(width, column + 30), initial_indent=head, subsequent_indent=indent
        ) or [head.rstrip()]
    return lines
