"""Converts the syntax tree of one file to the configuration message, by the schema's descriptors."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from joshua.textproto.field_table import ANY, FieldInfo, Kind, field_table
from joshua.textproto.nearest import nearest_first
from joshua.textproto.positions import Positions
from joshua.textproto.scalars import ScalarReader
from joshua.textproto.source import Span
from joshua.textproto.syntax import Block, Field, ListValue, Scalar, ScalarKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.plugin_types import PluginTypes
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Value


INCLUDE = "include"

_URL = r"[0-9a-zA-Z\-.~_!$&()*+,;=%/]+"
_TYPE_NAME = r"(?a)[^\d\W]\w*(\.[^\d\W]\w*)*"
_BAD_PERCENT = r"%(?![0-9a-fA-F]{2})"


class Merge:
    """State shared by the files of one load.

    Attributes:
        positions: positions of the fields; problems: errors found; types: of plugins' blocks.
        oneofs: path of a block and name of a oneof to the member that is set, and its position.
    """

    def __init__(self, positions: Positions, problems: Diagnostics, types: PluginTypes) -> None:
        self.positions = positions
        self.problems = problems
        self.types = types
        self.oneofs: dict[tuple[str, str], tuple[str, Span]] = {}


class Binder:
    """Binds the fields of one file.

    Args:
        include: called with the value and position of each ``include`` of the file; None if not allowed.
    """

    def __init__(
        self, source: Source, merge: Merge, include: Callable[[str, Span], None] | None = None
    ) -> None:
        self._source = source
        self._merge = merge
        self._problems = merge.problems
        self._positions = merge.positions
        self._scalars = ScalarReader(source, merge.problems)
        self._include = include
        self._written: dict[str, Span] = {}
        self._fields: list[tuple[int, int, str]] = []
        self._around: list[Any] = []

    def document(self, config: Any, fields: list[Field]) -> None:
        """Binds a whole file, and assigns its syntax errors to fields."""
        self._block(config, fields, "")
        if len(self._problems):
            self._problems.locate(self._source, self._fields)

    def field(self, message: Any, info: FieldInfo, field: Field, path: str) -> None:
        """Binds one field of a message; ``path`` is that of the message, "" for the root."""
        field_path = f"{path}.{info.name}" if path else info.name
        name = self._name_of(field)
        self._fields.append((field.name_start, field.end, field_path))
        if not field.has_colon and info.kind is not Kind.MESSAGE and isinstance(field.value, ListValue):
            remedy = f"Write `{field.name}: […]`."
            message_text = f"A colon is missing after {field.name}."
            self._problems.error("missing-colon", message_text, name, path=field_path, remedy=remedy)
        if info.is_repeated:
            self._repeated(message, info, field.value, field_path, name)
        elif self._is_free(info, field_path, name, path):
            self._singular(message, info, field.value, field_path, name)
        else:  # it is ignored, but its errors are reported
            aside = Binder(self._source, Merge(Positions(), self._problems, self._merge.types))
            aside._around = [*self._around]
            aside._singular(type(message)(), info, field.value, field_path, name)

    def entry(
        self, container: Any, index: int, info: FieldInfo, value: Value, path: str, name: Span, at: Span
    ) -> bool:
        """Binds one entry of a repeated field, replacing the existing one. False if it is broken.

        Args:
            name: position of the field's name; at: recorded position of a block.
        """
        if info.kind is not Kind.MESSAGE:
            found = self._scalars.read(info, value, path)
            if found is None:
                return False
            self._positions.record(path, name, self._span(value.start, value.end))
            container[index : index + 1] = [found]
        elif not isinstance(value, Block):
            self._not_a_block(info, value, path)
            return False
        else:
            self._positions.record(path, at, at)
            if info.is_map:
                self._map_entry(container, info, value, path)
            else:
                inner = container[index] if index < len(container) else container.add()
                inner.Clear()
                self._block(inner, value.fields, path)
        return True

    def _block(self, message: Any, fields: list[Field], path: str) -> None:
        if message.DESCRIPTOR.full_name == ANY and any(field.is_type for field in fields):
            self._any(message, fields, path)
            return
        table = field_table(message.DESCRIPTOR)
        self._around.append(message.DESCRIPTOR)
        for field in fields:
            if self._problems.full:
                return
            info = None if field.is_type else table.get(field.name)
            if info is None:
                from joshua.textproto.unknown_field import report_unknown_field

                report_unknown_field(self._problems, self._source, self._around, field, path)
            else:
                self.field(message, info, field, path)
        self._around.pop()

    def _span(self, start: int, end: int) -> Span:
        return Span(self._source, start, end)

    def _name_of(self, field: Field) -> Span:
        return Span(self._source, field.name_start, field.name_end)

    def _singular(self, message: Any, info: FieldInfo, value: Value | None, path: str, name: Span) -> None:
        if value is None:
            self._positions.record(path, name, name, is_broken=True)
        elif info.kind is not Kind.MESSAGE:
            found = self._scalars.read(info, value, path)
            place = self._span(value.start, value.end)
            self._positions.record(path, name, place, is_broken=found is None)
            if found is not None:
                setattr(message, info.name, found)
        elif isinstance(value, Block):
            self._positions.record(path, name, name)
            inner = getattr(message, info.name)
            inner.SetInParent()
            self._block(inner, value.fields, path)
        else:
            self._positions.record(path, name, name, is_broken=True)
            self._not_a_block(info, value, path)

    def _repeated(self, message: Any, info: FieldInfo, value: Value | None, path: str, name: Span) -> None:
        if value is None:
            self._positions.record(path, name, name, is_broken=True)
            return
        whole = name if isinstance(value, Block) else self._span(value.start, value.end)
        self._positions.record(path, name, whole)
        container = getattr(message, info.name)
        for item in value.items if isinstance(value, ListValue) else (value,):
            index = len(container)
            at = self._span(item.start, item.start + 1) if isinstance(value, ListValue) else name
            if not self.entry(container, index, info, item, f"{path}[{index}]", name, at):
                self._positions.mark_broken(path)
            elif self._include is not None and path == INCLUDE:
                self._include(container[index], self._span(item.start, item.end))

    def _map_entry(self, container: Any, info: FieldInfo, item: Block, path: str) -> None:
        entry = container.GetEntryClass()()
        self._block(entry, item.fields, path)
        if info.message.fields_by_name["value"].message_type is not None:
            container[entry.key].CopyFrom(entry.value)
        else:
            container[entry.key] = entry.value

    def _not_a_block(self, info: FieldInfo, value: Value, path: str) -> None:
        if isinstance(value, Scalar) and value.kind is ScalarKind.BROKEN:
            return
        found = "a list" if isinstance(value, ListValue) else "one value"
        self._problems.error(
            "wrong-type",
            f"{info.name} is a block of fields, not {found}.",
            self._span(value.start, value.end),
            path=path,
            allowed=(f"{info.name} {{ … }}",),
            remedy=f"Write `{info.name} {{` and its fields.",
        )

    def _is_free(self, info: FieldInfo, field_path: str, name: Span, path: str) -> bool:
        """Reports a field that is set twice, or together with another member of its oneof."""
        here = self._written.setdefault(field_path, name)
        before = self._positions.entry(field_path)
        if here is not name:
            code, message, first = "duplicate-field", f"{info.name} is set twice in one block.", here
        elif before is not None and (info.kind is not Kind.MESSAGE or info.is_any):
            code, first = "set-in-two-files", before.name
            message = f"{info.name} is also set in {first.source.name}."
        else:
            return self._is_only_member(info, field_path, name, path)
        self._problems.error(code, message, name, path=field_path, related=[(first, "first set here")])
        return False

    def _is_only_member(self, info: FieldInfo, field_path: str, name: Span, path: str) -> bool:
        member = info.name
        if info.oneof:
            member, place = self._merge.oneofs.setdefault((path, info.oneof), (info.name, name))
        if member == info.name:
            return True
        self._problems.error(
            "oneof-conflict",
            f"{info.name} conflicts with {member}: a block can contain only one of them.",
            name,
            path=field_path,
            remedy=f"Delete {info.name} or {member}.",
            related=[(place, f"{member} is set here")],
        )
        return False

    def _any(self, message: Any, fields: list[Field], path: str) -> None:
        """Binds the typed form of an ``Any`` block: one type in square brackets with its fields."""
        error = self._problems.error
        field = next(field for field in fields if field.is_type)
        name = self._name_of(field)
        for other in fields:
            if other is not field:
                text = f"A block with [{field.name}] can contain nothing else."
                related = [(name, "the type is set here")]
                error("mixed-any", text, self._name_of(other), path=path, related=related)
        type_name = self._type_name(field, path)
        if type_name is None:
            return
        if field.separator:
            # protobuf's parsers reject it, so such a file could be read only here.
            place = self._span(field.end, field.end + 1)
            text = f"'{field.separator}' cannot follow a block with a type in square brackets."
            error("unexpected-text", text, place, path=path, remedy="Delete it.")
        if not isinstance(field.value, Block):
            if field.value is not None:
                place = self._span(field.value.start, field.value.end)
                text = f"[{field.name}] must be followed by a block of fields."
                error("wrong-type", text, place, path=path, allowed=(f"[{field.name}] {{ … }}",))
            return
        found = self._merge.types.find(type_name)
        if found is None:
            self._report_unknown_type(type_name, name, path)
            # The type is kept for naming the missing plugin.
            message.type_url = field.name
            return
        inner: Any = found()
        self._block(inner, field.value.fields, path)
        if not inner.IsInitialized():
            missing = inner.FindInitializationErrors()
            text = f"{type_name} lacks {', '.join(missing)}."
            error("plugin-block-incomplete", text, name, path=path, found="", allowed=missing)
            return
        message.Pack(inner, type_url_prefix=field.name[: -len(type_name)])

    def _type_name(self, field: Field, path: str) -> str | None:
        """Extracts the full name of the type from its URL. Reports a malformed one."""
        prefix, slash, name = field.name.rpartition("/")
        if not slash:
            fault = 'lacks the domain and the "/" before the type'
        elif not prefix or prefix.startswith("/"):
            fault = 'lacks the domain before the "/"'
        elif re.fullmatch(_URL, field.name) is None or re.search(_BAD_PERCENT, prefix):
            fault = "contains a character that a type URL cannot contain"
        elif re.fullmatch(_TYPE_NAME, name) is None:
            fault = "does not end with the full name of a message"
        else:
            return name
        known = nearest_first(name or field.name, self._merge.types.names())
        self._problems.error(
            "bad-type-name",
            f"[{field.name}] {fault}.",
            self._name_of(field),
            path=path,
            found=f"[{field.name}]",
            allowed=[f"[type.googleapis.com/{item}]" for item in known],
        )
        return None

    def _report_unknown_type(self, type_name: str, at: Span, path: str) -> None:
        known = self._merge.types.names()
        text = f"No installed plugin provides {type_name}"
        if self._merge.types.is_misspelt(type_name):
            code, allowed, is_note = "unknown-plugin-type", nearest_first(type_name, known), False
        else:
            code, allowed, is_note = "plugin-type-not-installed", known, True
            text += "; its fields are not checked"
        self._problems.error(
            code, f"{text}.", at, path=path, found=type_name, allowed=allowed, is_note=is_note
        )
