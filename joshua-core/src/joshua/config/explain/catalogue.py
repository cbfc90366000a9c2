"""Everything that can be explained, and how a word of the user finds it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from joshua.config.codes import CODES
from joshua.schema.config_pb2 import Config
from joshua.textproto.field_table import ANY
from joshua.textproto.nearest import nearest
from joshua.textproto.plugin_types import PluginTypes

_MOST_SUGGESTIONS = 6
_PART = 400
_INDEX = re.compile(r"\[[^\]]*\]")


@dataclass(frozen=True)
class Place:
    """A field and the path by which a file reaches it, such as ``robot.actions.node.qos``."""

    path: str
    field: Any


class Catalogue:
    """The schema as a list of names.

    Args:
        plugin_types: gives the messages of plugins; called only when a name is not the core's own.
    """

    def __init__(self, plugin_types: Callable[[], PluginTypes] = lambda: PluginTypes(())) -> None:
        self._plugin_types = plugin_types

    @cached_property
    def places(self) -> list[Place]:
        """Every field of a file, from the root down."""
        return _places(Config.DESCRIPTOR, "")

    @cached_property
    def plugin_messages(self) -> list[Any]:
        """Descriptors of the messages that plugins bring."""
        types = self._plugin_types()
        found = [types.find(name) for name in types.names()]
        return [item.DESCRIPTOR for item in found if item is not None]

    @cached_property
    def messages(self) -> dict[str, Any]:
        """Blocks of the core, by the name of their message."""
        fields = [place.field.message_type for place in self.places]
        found = [Config.DESCRIPTOR, *(item for item in fields if item is not None and item.full_name != ANY)]
        return {item.name: item for item in found}

    @cached_property
    def enums(self) -> dict[str, Any]:
        """Enums of the core, by name."""
        fields = [place.field.enum_type for place in self.places]
        return {item.name: item for item in fields if item is not None}

    def find(self, query: str) -> list[Any]:
        """Finds what a user's word means.

        Args:
            query: a field path (indices are ignored), its end, a message, a message and a field, an enum,
                an enum value, or a diagnostic code.

        Returns:
            Places, descriptors of messages, enums or enum values, or the code as a string; several where
            the word stands for several, none where it is unknown.
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
        """Returns known names that look like a query, the nearest first."""
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
        # One search looks at so many names only, so it is made in parts.
        parts = [known[start : start + _PART] for start in range(0, len(known), _PART)]
        alike = [name for part in parts for name in nearest(leaf, part, _MOST_SUGGESTIONS)]
        ordered = nearest(leaf, alike, _MOST_SUGGESTIONS)
        return [by_leaf[name] for name in dict.fromkeys((*ordered, *alike))][:_MOST_SUGGESTIONS]

    def _by_step(self, word: str) -> list[str]:
        """Follows a path as far as it is right and offers the fields that resemble the first wrong step."""
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
                # Without a like name, the block in which the path is still right is the best help.
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
        """Finds ``Publisher.topic_name`` and ``Publisher.qos.depth``."""
        name, _, rest = word.partition(".")
        message = self.messages.get(name)
        if message is None or not rest:
            return []
        return [place for place in _places(message, name) if place.path == word]

    def _of_plugin(self, word: str) -> list[Any]:
        """Finds the message of a plugin, a field of it, and ``plugin_config.FIELD``."""
        last = word.rpartition(".")[0].rpartition(".")[2]
        if not self._may_be_plugin(word, last):
            return []
        found: list[Any] = []
        for message in self.plugin_messages:
            if word in (message.full_name, message.name):
                return [message]
            for place in _places(message, message.full_name):
                inner = place.path.removeprefix(f"{message.full_name}.")
                if word in (place.path, f"{message.name}.{inner}") or word.endswith(f"plugin_config.{inner}"):
                    found.append(place)
        return found

    @staticmethod
    def _may_be_plugin(word: str, owner: str) -> bool:
        """Whether a word may mean something of a plugin; a bare field name never does."""
        return "." in word or word[:1].isupper() or owner == "plugin_config"

    def _ends_with(self, word: str) -> list[Any]:
        """Finds the fields whose paths end in a word: one place for each message that has such a field."""
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
    """Lists the fields of a message and of the blocks in it; a block inside itself is left out."""
    found: list[Place] = []
    for field in message.fields:
        field_path = f"{path}.{field.name}" if path else field.name
        found.append(Place(field_path, field))
        inner = field.message_type
        if inner is not None and inner.full_name not in (*around, message.full_name, ANY):
            found += _places(inner, field_path, (*around, message.full_name))
    return found
