"""``joshua explain``: the documentation of every block, field and value, taken from the schema."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from joshua.config.codes import CODES
from joshua.schema import options_pb2
from joshua.schema.comments import comment
from joshua.schema.config_pb2 import Config
from joshua.schema.extensions import is_extension
from joshua.textproto.field_facts import field_facts
from joshua.textproto.field_table import ANY, field_table
from joshua.textproto.nearest import nearest
from joshua.textproto.plugin_types import PluginTypes

_LABEL = 10
_MOST_USERS = 4
_MOST_SUGGESTIONS = 6
_PART = 400
_INDEX = re.compile(r"\[[^\]]*\]")


@dataclass(frozen=True)
class Place:
    """A field and its path in a file, such as ``robot.actions.node.qos``."""

    path: str
    field: Any


class Catalogue:
    """The schema as a list of names.

    Args:
        plugin_types: returns the messages of plugins. Called only for a name unknown to the core.
    """

    def __init__(self, plugin_types: Callable[[], PluginTypes] = lambda: PluginTypes(())) -> None:
        self._plugin_types = plugin_types

    @cached_property
    def places(self) -> list[Place]:
        """Every field of a file, from the root down."""
        return _places(Config.DESCRIPTOR, "")

    @cached_property
    def plugin_messages(self) -> list[Any]:
        """Descriptors of the messages of plugins."""
        types = self._plugin_types()
        found = [types.find(name) for name in types.names()]
        return [item.DESCRIPTOR for item in found if item is not None]

    @cached_property
    def messages(self) -> dict[str, Any]:
        """Blocks of the core, by message name."""
        fields = [place.field.message_type for place in self.places]
        found = [Config.DESCRIPTOR, *(item for item in fields if item is not None and item.full_name != ANY)]
        return {item.name: item for item in found}

    @cached_property
    def enums(self) -> dict[str, Any]:
        """Enums of the core, by name."""
        fields = [place.field.enum_type for place in self.places]
        return {item.name: item for item in fields if item is not None}

    def find(self, query: str) -> list[Any]:
        """Find the meaning of a user's query.

        Args:
            query: a field path (indices are ignored), its end, a message, a message and a field, an enum,
                an enum value, or a diagnostic code.

        Returns:
            Places, descriptors of messages, enums or enum values, or the code as a string. Several where
            the query is ambiguous, none if it is unknown.
        """
        word = _INDEX.sub("", query).strip().strip(".")
        word = word.removeprefix("joshua.")
        return (
            self._exact(word)
            or self._of_core_message(word)
            or self._of_plugin(word)
            or self._ends_with(word)
            or self._enum_value(word)
        )

    def suggestions(self, query: str) -> list[str]:
        """Return known names that look like a query, the nearest first."""
        word = _INDEX.sub("", query).strip()
        by_step = self._by_step(word) if "." in word else []
        if by_step:
            return by_step
        values = [value.name for enum in self.enums.values() for value in enum.values]
        names = [
            *self.messages,
            *self.enums,
            *CODES,
            *(message.full_name for message in self.plugin_messages),
        ]
        by_leaf: dict[str, str] = {}
        for name in (*(place.path for place in self.places), *names, *values):
            by_leaf.setdefault(name.rpartition(".")[2], name)
        leaf = word.rpartition(".")[2]
        known = list(by_leaf)
        # A search is limited to a number of names, so it is split.
        parts = [known[start : start + _PART] for start in range(0, len(known), _PART)]
        alike = [name for part in parts for name in nearest(leaf, part, _MOST_SUGGESTIONS)]
        ordered = nearest(leaf, alike, _MOST_SUGGESTIONS)
        return [by_leaf[name] for name in dict.fromkeys((*ordered, *alike))][:_MOST_SUGGESTIONS]

    def _by_step(self, word: str) -> list[str]:
        """Follow a path as far as it is valid, and suggest fields similar to the first invalid step."""
        known = {place.path for place in self.places}
        steps = word.split(".")
        message = Config.DESCRIPTOR
        for number, step in enumerate(steps):
            field = message.fields_by_name.get(step)
            if field is None:
                near = nearest(step, [other.name for other in message.fields])
                paths = [[*steps[:number], name] for name in near]
                whole = [[*path, *steps[number + 1 :]] for path in paths]
                ends = [".".join(path) for path in whole if ".".join(path) in known]
                # Without a similar name, suggest the last valid block of the path.
                return ends or [".".join(path) for path in paths] or [".".join(steps[:number])][: number > 0]
            if field.message_type is None:
                return [".".join(steps[: number + 1])]
            message = field.message_type
        return []

    def _exact(self, word: str) -> list[Any]:
        for place in self.places:
            if place.path == word:
                return [place]
        if word in self.messages:
            return [self.messages[word]]
        if word in self.enums:
            return [self.enums[word]]
        return [word] if word in CODES else []

    def _of_core_message(self, word: str) -> list[Any]:
        """Find ``Publisher.topic_name`` and ``Publisher.qos.depth``."""
        name, _, rest = word.partition(".")
        message = self.messages.get(name)
        if message is None or not rest:
            return []
        return [place for place in _places(message, name) if place.path == word]

    def _of_plugin(self, word: str) -> list[Any]:
        """Find the message of a plugin, a field of it, and ``plugin_config.FIELD``."""
        if "." not in word and not word[:1].isupper():
            return []  # a bare field name never refers to a plugin
        found: list[Any] = []
        for message in self.plugin_messages:
            if word in (message.full_name, message.name):
                return [message]
            for place in _places(message, message.full_name):
                inner = place.path.removeprefix(f"{message.full_name}.")
                if word in (place.path, f"{message.name}.{inner}") or word.endswith(f"plugin_config.{inner}"):
                    found.append(place)
        return found

    def _ends_with(self, word: str) -> list[Any]:
        """Find the fields whose paths end in a word: one place per message with such a field."""
        found: dict[str, Place] = {}
        for place in self.places:
            if place.path.endswith(f".{word}"):
                found.setdefault(place.field.full_name, place)
        return list(found.values())

    def _enum_value(self, word: str) -> list[Any]:
        name = word.rpartition(".")[2]
        if not name.isascii():
            return []
        found = [enum.values_by_name[name] for enum in self.enums.values() if name in enum.values_by_name]
        return found[:1]


def _places(message: Any, path: str, around: tuple[str, ...] = ()) -> list[Place]:
    """List the fields of a message and its blocks, without recursion into the same block."""
    found: list[Place] = []
    for field in message.fields:
        field_path = f"{path}.{field.name}" if path else field.name
        found.append(Place(field_path, field))
        inner = field.message_type
        if inner is not None and inner.full_name not in (*around, message.full_name, ANY):
            found += _places(inner, field_path, (*around, message.full_name))
    return found


def overview(width: int) -> str:
    """Return the page of the whole file: its blocks, and further queries."""
    lines = ["A configuration file holds these blocks and fields:", ""]
    lines += _children(Config.DESCRIPTOR, width)
    lines += ["", "joshua explain robot.actions          the fields of a block"]
    lines += ["joshua explain general.mode           one field and the values that it takes"]
    lines += ["joshua explain MODE_TEST              one value, message or diagnostic code"]
    return "\n".join(lines) + "\n"


def explain(found: list[Any], catalogue: Catalogue, width: int) -> str:
    """Return the page of the result of ``Catalogue.find``, or a list if there are several."""
    if len(found) > 1:
        lines = ["Several fields have this name:", ""]
        lines += _table([(place.path, first_sentence(comment(place.field))) for place in found], width)
        return "\n".join(lines) + "\n"
    item = found[0]
    if isinstance(item, str):
        lines = _code(item, width)
    elif isinstance(item, Place):
        lines = _field(item, catalogue, width)
    elif hasattr(item, "fields_by_name"):
        lines = [f"{item.full_name}: block", "", *_wrap(comment(item), width), ""]
        lines += _users([place for place in catalogue.places if place.field.message_type is item], width)
        lines += _children(item, width)
    elif hasattr(item, "values_by_name"):
        lines = [f"{item.name}: names of which one is written", "", *_wrap(comment(item), width), ""]
        lines += _users([place for place in catalogue.places if place.field.enum_type is item], width)
        lines += _values(item, width)
    else:
        lines = _value(item, catalogue, width)
    return "\n".join(lines).rstrip() + "\n"


def first_sentence(text: str) -> str:
    """Return the first sentence of a comment."""
    head = text.partition("\n")[0]
    end = head.find(". ")
    return head if end == -1 else head[: end + 1]


def _code(code: str, width: int) -> list[str]:
    row = CODES[code]
    return [
        f"{code}: diagnostic",
        "",
        *_labelled("cause", row.cause, width),
        *_labelled("do", row.next_step, width),
    ]


def _field(place: Place, catalogue: Catalogue, width: int) -> list[str]:
    field = place.field
    lines = [f"{place.path}: {type_text(field)}", "", *_wrap(comment(field), width), ""]
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
    """Return the rule of a field as labels and texts, for people."""
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
    """Return the type of a field in words, such as ``list: whole number for each entry``."""
    info = field_table(field.containing_type)[field.name]
    if info.message is None:
        return f"list: {info.type_text} for each entry" if info.is_repeated else info.type_text
    name = "block of a plugin" if info.is_any else "block"
    return f"{name}, may be repeated" if info.is_repeated else name


def _plugin_blocks(field: Any, catalogue: Catalogue, width: int) -> list[str]:
    messages = catalogue.plugin_messages
    if not messages:
        return _wrap("No installed plugin provides a block; `joshua plugins` lists them.", width)
    rows = [(item.full_name, first_sentence(comment(item))) for item in messages]
    sample = f"{field.name} {{ [type.googleapis.com/{messages[0].full_name}] {{ … }} }}"
    return [
        "Types of the installed plugins:",
        *_table(rows, width),
        "",
        *_labelled("written", sample, width),
    ]


def _value(value: Any, catalogue: Catalogue, width: int) -> list[str]:
    lines = [f"{value.name}: value of {value.type.name}", "", *_wrap(comment(value), width), ""]
    lines += _users([place for place in catalogue.places if place.field.enum_type is value.type], width)
    lines += _labelled("schema", f"{value.type.full_name}, number {value.number}{_origin(value)}", width)
    return lines


def _users(places: list[Place], width: int) -> list[str]:
    """List the fields of a file that contain a block or an enum."""
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
    """Whether all fields of a block are extensions, so that marking each is useless."""
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
    """Print two columns. A name longer than its column gets a separate line."""
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
