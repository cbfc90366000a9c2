"""The syntax tree of one file into the configuration message, by the descriptors of the schema."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from joshua.textproto.diagnostics import Span
from joshua.textproto.field_table import ANY, FieldInfo, Kind, field_table
from joshua.textproto.nearest import nearest_first
from joshua.textproto.positions import Positions
from joshua.textproto.scalars import ScalarReader
from joshua.textproto.syntax import Block, Field, ListValue, Scalar, ScalarKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.plugin_types import PluginTypes
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Field, Value


INCLUDE = "include"


class Merge:
    """What the files of one load share.

    Attributes:
        positions: where each field stands; problems: what is wrong; types: of plugins' blocks.
        oneofs: path of a block and name of a oneof to the member that is written, and where.
    """

    def __init__(self, positions: Positions, problems: Diagnostics, types: PluginTypes) -> None:
        self.positions = positions
        self.problems = problems
        self.types = types
        self.oneofs: dict[tuple[str, str], tuple[str, Span]] = {}

    def aside(self) -> Merge:
        """Returns a merge whose result is dropped, for a block that counts for nothing."""
        return Merge(Positions(), self.problems, self.types)


class Binder:
    """Binds the fields of one file.

    Args:
        include: called with the value and place of each ``include`` of the file; None where none is allowed.
    """

    def __init__(
        self, source: Source, merge: Merge, include: Callable[[str, Span], None] | None = None
    ) -> None:
        self.source = source
        self.merge = merge
        self.problems = merge.problems
        self._positions = merge.positions
        self._scalars = ScalarReader(source, merge.problems)
        self._include = include
        self._written: dict[str, Span] = {}
        self._fields: list[tuple[int, int, str]] = []
        self._around: list[Any] = []

    def block(self, message: Any, fields: list[Field], path: str) -> None:
        """Binds the fields of a block into a message; ``path`` is that of the block, "" for the root."""
        if message.DESCRIPTOR.full_name == ANY and any(field.is_type for field in fields):
            bind_any(self, message, fields, path)
            return
        table = field_table(message.DESCRIPTOR)
        self._around.append(message.DESCRIPTOR)
        for field in fields:
            if self.problems.full:
                return
            info = None if field.is_type else table.get(field.name)
            if info is None:
                from joshua.textproto.unknown_field import report_unknown_field

                report_unknown_field(self.problems, self.source, self._around, field, path)
            else:
                self.field(message, info, field, path)
        self._around.pop()

    def document(self, config: Any, fields: list[Field]) -> None:
        """Binds a whole file, and tells the syntax errors in it which fields they belong to."""
        self.block(config, fields, "")
        if len(self.problems):
            self.problems.locate(self.source, self._fields)

    def field(self, message: Any, info: FieldInfo, field: Field, path: str) -> None:
        """Binds one field of a message."""
        field_path = f"{path}.{info.name}" if path else info.name
        name = Span(self.source, field.name_start, field.name_end)
        value = field.value
        self._fields.append((field.name_start, field.end, field_path))
        is_list = isinstance(value, ListValue)
        if not field.has_colon and info.kind is not Kind.MESSAGE and is_list:
            self.problems.error(
                "missing-colon",
                f"A colon is missing after {field.name}.",
                name,
                path=field_path,
                found=field.name,
                remedy=f"Write `{field.name}: […]`.",
            )
        if info.is_repeated:
            self._repeated(message, info, value, field_path, name)
        elif self._is_free(info, field_path, name, path):
            self._singular(message, info, value, field_path, name)
        else:
            aside = Binder(self.source, self.merge.aside())
            aside._around = [*self._around]
            aside._singular(type(message)(), info, value, field_path, name)

    def scalar(self, info: FieldInfo, value: Value, path: str) -> Any:
        """Reads a scalar; None where it does not fit the field, which is reported."""
        return self._scalars.read(info, value, path)

    def span(self, start: int, end: int) -> Span:
        """A piece of this file."""
        return Span(self.source, start, end)

    def _singular(self, message: Any, info: FieldInfo, value: Value | None, path: str, name: Span) -> None:
        if value is None:
            self._positions.record(path, name, name, is_broken=True)
        elif info.kind is not Kind.MESSAGE:
            found = self._scalars.read(info, value, path)
            place = Span(self.source, value.start, value.end)
            self._positions.record(path, name, place, is_broken=found is None)
            if found is not None:
                setattr(message, info.name, found)
        elif isinstance(value, Block):
            self._positions.record(path, name, name)
            inner = getattr(message, info.name)
            inner.SetInParent()
            self.block(inner, value.fields, path)
        else:
            self._positions.record(path, name, name, is_broken=True)
            self._not_a_block(info, value, path)

    def _repeated(self, message: Any, info: FieldInfo, value: Value | None, path: str, name: Span) -> None:
        if value is None:
            self._positions.record(path, name, name, is_broken=True)
            return
        whole = name if isinstance(value, Block) else Span(self.source, value.start, value.end)
        self._positions.record(path, name, whole)
        container = getattr(message, info.name)
        for item in value.items if isinstance(value, ListValue) else (value,):
            item_path = f"{path}[{len(container)}]"
            if info.kind is Kind.MESSAGE:
                if not isinstance(item, Block):
                    self._positions.mark_broken(path)
                    self._not_a_block(info, item, item_path)
                    continue
                at = Span(self.source, item.start, item.start + 1) if isinstance(value, ListValue) else name
                self._positions.record(item_path, at, at)
                if info.is_map:
                    self._map_entry(container, info, item, item_path)
                else:
                    self.block(container.add(), item.fields, item_path)
                continue
            found = self._scalars.read(info, item, item_path)
            if found is None:
                self._positions.mark_broken(path)
                continue
            place = Span(self.source, item.start, item.end)
            self._positions.record(item_path, name, place)
            container.append(found)
            if self._include is not None and path == INCLUDE:
                self._include(found, place)

    def _map_entry(self, container: Any, info: FieldInfo, item: Block, path: str) -> None:
        entry = container.GetEntryClass()()
        self.block(entry, item.fields, path)
        if info.message.fields_by_name["value"].message_type is not None:
            container[entry.key].CopyFrom(entry.value)
        else:
            container[entry.key] = entry.value

    def _not_a_block(self, info: FieldInfo, value: Value, path: str) -> None:
        if isinstance(value, Scalar) and value.kind is ScalarKind.BROKEN:
            return
        found = "a list" if isinstance(value, ListValue) else "one value"
        self.problems.error(
            "wrong-type",
            f"{info.name} is a block of fields, not {found}.",
            self.span(value.start, value.end),
            path=path,
            found=self.source.text[value.start : value.end].partition("\n")[0],
            allowed=(f"{info.name} {{ … }}",),
            remedy=f"Write `{info.name} {{` and its fields.",
        )

    def _is_free(self, info: FieldInfo, field_path: str, name: Span, path: str) -> bool:
        """Reports a field that is written twice, or beside another member of its oneof."""
        here = self._written.setdefault(field_path, name)
        if here is not name:
            self._twice(
                "duplicate-field", f"{info.name} is written twice in one block.", field_path, name, here
            )
            return False
        merges = info.kind is Kind.MESSAGE and not info.is_any
        before = self._positions.entry(field_path)
        if before is not None and not merges:
            self._twice(
                "set-in-two-files",
                f"{info.name} is also set in {before.name.source.name}.",
                field_path,
                name,
                before.name,
            )
            return False
        if info.oneof:
            member, place = self.merge.oneofs.setdefault((path, info.oneof), (info.name, name))
            if member != info.name:
                self.problems.error(
                    "oneof-conflict",
                    f"{info.name} cannot stand beside {member}: a block holds one of them.",
                    name,
                    path=field_path,
                    found=info.name,
                    remedy=f"Delete {info.name} or {member}.",
                    related=[(place, f"{member} is written here")],
                )
                return False
        return True

    def _twice(self, code: str, message: str, path: str, name: Span, first: Span) -> None:
        found = self.source.text[name.start : name.end]
        self.problems.error(
            code, message, name, path=path, found=found, related=[(first, "it is written first here")]
        )


_URL = re.compile(r"[0-9a-zA-Z\-.~_!$&()*+,;=%/]+")
_TYPE_NAME = re.compile(r"[^\d\W]\w*(\.[^\d\W]\w*)*", re.ASCII)
_BAD_PERCENT = re.compile(r"%(?![0-9a-fA-F]{2})")


def bind_any(binder: Binder, message: Any, fields: list[Field], path: str) -> None:
    """Binds the typed form of an ``Any`` block: one type in square brackets with its fields."""
    field = next(field for field in fields if field.is_type)
    for other in fields:
        if other is not field:
            place = binder.span(other.name_start, other.name_end)
            first = binder.span(field.name_start, field.name_end)
            binder.problems.error(
                "mixed-any",
                f"[{field.name}] takes the whole block; nothing else stands beside it.",
                place,
                path=path,
                found=binder.source.text[other.name_start : other.name_end],
                related=[(first, "the type is given here")],
            )
    type_name = _type_name(binder, field, path)
    if type_name is None:
        return
    if field.separator:
        # protobuf's own readers refuse it, so a file with it would be readable here only.
        place = binder.span(field.end, field.end + 1)
        binder.problems.error(
            "unexpected-text",
            f"'{field.separator}' stands after a block with a type in square brackets.",
            place,
            path=path,
            found=field.separator,
            remedy="Delete it.",
        )
    if not isinstance(field.value, Block):
        if field.value is not None:
            binder.problems.error(
                "wrong-type",
                f"[{field.name}] is followed by a block of fields.",
                binder.span(field.value.start, field.value.end),
                path=path,
                allowed=(f"[{field.name}] {{ … }}",),
            )
        return
    prefix = field.name[: -len(type_name)]
    found = binder.merge.types.find(type_name)
    if found is None:
        _report_unknown_type(binder, field, type_name, path)
        # The type stays known, so that the missing plugin can be named.
        message.type_url = field.name
        return
    inner: Any = found()
    binder.block(inner, field.value.fields, path)
    if not inner.IsInitialized():
        missing = inner.FindInitializationErrors()
        binder.problems.error(
            "plugin-block-incomplete",
            f"{type_name} lacks {', '.join(missing)}.",
            binder.span(field.name_start, field.name_end),
            path=path,
            allowed=missing,
        )
        return
    message.Pack(inner, type_url_prefix=prefix)


def _type_name(binder: Binder, field: Field, path: str) -> str | None:
    """Takes the full name of the type out of its URL; reports a malformed one."""
    prefix, slash, name = field.name.rpartition("/")
    fault = ""
    if not slash:
        fault = "lacks the domain and the / before the type"
    elif not prefix or prefix.startswith("/"):
        fault = "lacks the domain before the /"
    elif _URL.fullmatch(field.name) is None or _BAD_PERCENT.search(prefix):
        fault = "holds a character that no type URL holds"
    elif _TYPE_NAME.fullmatch(name) is None:
        fault = "does not end in the full name of a message"
    if not fault:
        return name
    known = binder.merge.types.names()
    allowed = [f"type.googleapis.com/{item}" for item in nearest_first(name or field.name, known)]
    binder.problems.error(
        "bad-type-name",
        f"[{field.name}] {fault}.",
        binder.span(field.name_start, field.name_end),
        path=path,
        found=f"[{field.name}]",
        allowed=[f"[{item}]" for item in allowed],
    )
    return None


def _report_unknown_type(binder: Binder, field: Field, type_name: str, path: str) -> None:
    place = binder.span(field.name_start, field.name_end)
    known = binder.merge.types.names()
    if binder.merge.types.is_misspelt(type_name):
        binder.problems.error(
            "unknown-plugin-type",
            f"No plugin that is installed provides {type_name}.",
            place,
            path=path,
            found=type_name,
            allowed=nearest_first(type_name, known),
        )
    else:
        binder.problems.error(
            "plugin-type-not-installed",
            f"No plugin that is installed provides {type_name}; the fields of this block are not checked.",
            place,
            path=path,
            found=type_name,
            allowed=known,
            is_note=True,
        )
