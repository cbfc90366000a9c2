"""Positions of the fields of a configuration, recorded by the reader."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

    from joshua.plan import Position
    from joshua.textproto.diagnostics import Span


class Entry(NamedTuple):
    """Positions of one field: its name and its value. For a block, both are its name."""

    name: Span
    value: Span
    is_broken: bool


class Positions:
    """Positions by field path, such as ``robot.actions[0].sts3215_config.comm.serial.port``.

    Inside a plugin's block, the path continues with the plugin's fields:
    ``robot.actions[1].plugin_config.stroke_m``. A repeated field has an entry for each of its elements
    (``motor_ids[2]``) and one for the field itself, at its first occurrence.
    """

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}

    def value(self, field_path: str) -> Position | None:
        """Return the position of a field's value, or of a block's name; None if it is not set."""
        entry = self._entries.get(field_path)
        return entry.value.position if entry is not None else None

    def name(self, field_path: str) -> Position | None:
        """Return the position of a field's name; None if it is not set."""
        entry = self._entries.get(field_path)
        return entry.name.position if entry is not None else None

    def is_set(self, field_path: str) -> bool:
        """Whether a field is set, with any value, including 0 and a broken one."""
        return field_path in self._entries

    def is_broken(self, field_path: str) -> bool:
        """Whether a field is set to a value that could not be read.

        The message then has the field's default, which needs no further findings.
        """
        entry = self._entries.get(field_path)
        return entry is not None and entry.is_broken

    def nearest(self, field_path: str) -> Position | None:
        """Return the position of a field, or of the innermost enclosing block that is set."""
        path = field_path
        while path:
            entry = self._entries.get(path)
            if entry is not None:
                return entry.value.position
            path = parent(path)
        return None

    def paths(self) -> Iterator[str]:
        """Yield all paths that are set, in the order of reading."""
        return iter(self._entries)

    def entry(self, field_path: str) -> Entry | None:
        """Returns the entry of a path, for the reader itself."""
        return self._entries.get(field_path)

    def record(self, field_path: str, name: Span, value: Span, *, is_broken: bool = False) -> None:
        """Record the position of a field. The first position of a path wins."""
        self._entries.setdefault(field_path, Entry(name, value, is_broken))

    def mark_broken(self, field_path: str) -> None:
        """Record that a value of a field could not be read."""
        entry = self._entries.get(field_path)
        if entry is not None:
            self._entries[field_path] = entry._replace(is_broken=True)

    def discard(self, field_path: str) -> None:
        """Remove a field and all below it."""
        inside = (f"{field_path}.", f"{field_path}[")
        for path in [known for known in self._entries if known == field_path or known.startswith(inside)]:
            del self._entries[path]


def parent(field_path: str) -> str:
    """Return the enclosing path: ``a.b[1]`` to ``a.b``, ``a.b`` to ``a``, ``a`` to ""."""
    if field_path.endswith("]"):
        return field_path[: field_path.rfind("[")]
    return field_path.rpartition(".")[0]
