"""Where each field of a configuration stands: the memory of the reader."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

    from joshua.plan import Position
    from joshua.textproto.diagnostics import Span


class Entry(NamedTuple):
    """Where one field stands: its name, and its value; for a block both are its name."""

    name: Span
    value: Span
    is_broken: bool


class Positions:
    """Field paths to places, such as ``robot.actions[0].sts3215_config.comm.serial.port``.

    Inside a plugin's block the path goes on with the plugin's own fields:
    ``robot.actions[1].plugin_config.stroke_m``. A repeated field has an entry for each of its
    elements (``motor_ids[2]``) and one for the field itself, at the first place where it is written.
    """

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}

    def value(self, field_path: str) -> Position | None:
        """Returns the place of a field's value; of its name for a block; None where it is not written."""
        entry = self._entries.get(field_path)
        return entry.value.position if entry is not None else None

    def name(self, field_path: str) -> Position | None:
        """Returns the place of a field's name; None where it is not written."""
        entry = self._entries.get(field_path)
        return entry.name.position if entry is not None else None

    def is_set(self, field_path: str) -> bool:
        """Tells whether a field is written, with whatever value: 0 counts, and so does a broken one."""
        return field_path in self._entries

    def is_broken(self, field_path: str) -> bool:
        """Tells whether a field is written with a value that could not be read.

        The message then holds the field's default, about which nothing more need be said.
        """
        entry = self._entries.get(field_path)
        return entry is not None and entry.is_broken

    def nearest(self, field_path: str) -> Position | None:
        """Returns the place of a field, or of the innermost block around it that is written."""
        path = field_path
        while path:
            entry = self._entries.get(path)
            if entry is not None:
                return entry.value.position
            path = parent(path)
        return None

    def paths(self) -> Iterator[str]:
        """Yields all paths that are written, in the order of reading."""
        return iter(self._entries)

    def entry(self, field_path: str) -> Entry | None:
        """Returns the entry of a path, for the reader itself."""
        return self._entries.get(field_path)

    def record(self, field_path: str, name: Span, value: Span, *, is_broken: bool = False) -> None:
        """Remembers where a field stands; the first place of a path wins."""
        self._entries.setdefault(field_path, Entry(name, value, is_broken))

    def mark_broken(self, field_path: str) -> None:
        """Remembers that a value of a field could not be read."""
        entry = self._entries.get(field_path)
        if entry is not None:
            self._entries[field_path] = entry._replace(is_broken=True)

    def discard(self, field_path: str) -> None:
        """Forgets a field and all below it."""
        inside = (f"{field_path}.", f"{field_path}[")
        for path in [known for known in self._entries if known == field_path or known.startswith(inside)]:
            del self._entries[path]


def parent(field_path: str) -> str:
    """Returns the path around a path: ``a.b[1]`` to ``a.b``, ``a.b`` to ``a``, ``a`` to ""."""
    if field_path.endswith("]"):
        return field_path[: field_path.rfind("[")]
    return field_path.rpartition(".")[0]
