"""The message types allowed in a ``plugin_config`` block."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    from google.protobuf.message import Message

_ALIKE = 0.85


class PluginTypes:
    """Finds the class of a message by its full name. Loads plugins only if a block needs them.

    Args:
        message_types: message classes, or import strings of compiled ``_pb2`` modules.
    """

    def __init__(self, message_types: Iterable[str | type[Message]]) -> None:
        self._given = tuple(message_types)
        self._classes: dict[str, type[Message]] | None = None

    def names(self) -> list[str]:
        """Return the full names of the plugins' types."""
        return sorted(self._known())

    def find(self, full_name: str) -> type[Message] | None:
        """Return the class of a type, from the plugins or from any imported compiled module."""
        found = self._known().get(full_name)
        if found is not None:
            return found
        from google.protobuf import descriptor_pool, message_factory

        try:
            descriptor = descriptor_pool.Default().FindMessageTypeByName(full_name)
        except KeyError:
            return None
        return message_factory.GetMessageClass(descriptor)

    def is_misspelt(self, full_name: str) -> bool:
        """Whether an unknown name looks like a misspelt known one rather than a missing plugin's."""
        import difflib

        package = full_name.rpartition(".")[0]
        return any(
            known.rpartition(".")[0] == package
            or difflib.SequenceMatcher(None, full_name.lower(), known.lower()).ratio() >= _ALIKE
            for known in self._known()
        )

    def _known(self) -> dict[str, type[Message]]:
        if self._classes is None:
            self._classes = {}
            for given in self._given:
                for found in _classes_of(given):
                    self._classes[found.DESCRIPTOR.full_name] = found
        return self._classes


def _classes_of(given: str | type[Message]) -> list[type[Message]]:
    if not isinstance(given, str):
        return [given]
    from google.protobuf import message_factory

    module: Any = sys.modules.get(given)
    if module is None:
        try:
            module = importlib.import_module(given)
        except ImportError:
            return []  # the plugin host reports plugins that cannot be imported
    messages = module.DESCRIPTOR.message_types_by_name.values()
    return [message_factory.GetMessageClass(message) for message in messages]
