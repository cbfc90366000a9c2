"""Applies the ``--set`` options to a merged configuration: each replaces what stood there."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

from joshua.textproto.binder import INCLUDE, Binder, Merge
from joshua.textproto.diagnostics import Span
from joshua.textproto.field_table import ANY, FieldInfo, Kind, field_table
from joshua.textproto.lexer import tokenize
from joshua.textproto.parser import Parser
from joshua.textproto.source import Source
from joshua.textproto.syntax import Block, Field, ListValue, Scalar, ScalarKind
from joshua.textproto.unknown_field import report_unknown_field

if TYPE_CHECKING:
    from collections.abc import Sequence

OPTION = "--set"

_STEP = re.compile(
    r"\s*([A-Za-z_]\w*)\s*(?:\[\s*(?:\"([^\"\]]*)\"|'([^'\]]*)'|([^\]\"'=:{]*?))\s*\])?\s*", re.ASCII
)


class Step(NamedTuple):
    """One field of a path.

    Attributes:
        key: what stands in brackets; None where no brackets stand.
        start, end: offsets of the step in the option.
    """

    name: str
    key: str | None
    start: int
    end: int

    @property
    def number(self) -> int | None:
        """The index in the brackets; None where they hold a name."""
        if self.key is None or not self.key.isascii() or not self.key.isdigit() or len(self.key) > 9:
            return None
        return int(self.key)


class PathSyntaxError(ValueError):
    """A path that cannot be read; ``offset`` is where."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


def split_option(text: str) -> tuple[list[Step], int]:
    """Splits an option into its path and the offset at which the value begins.

    Raises:
        PathSyntaxError: if the option is not of the form ``PATH=VALUE`` or ``PATH { … }``.
    """
    steps: list[Step] = []
    at = 0
    while True:
        match = _STEP.match(text, at)
        if match is None:
            raise PathSyntaxError("a field name is expected here", min(at, max(len(text) - 1, 0)))
        key = next((found for found in match.groups()[1:] if found is not None), None)
        steps.append(Step(match[1], key, match.start(1), len(text[: match.end()].rstrip())))
        at = match.end()
        sign = text[at : at + 1]
        if sign == ".":
            at += 1
        elif sign in ("=", ":"):
            return steps, at + 1
        elif sign in ("{", "<"):
            return steps, at
        else:
            raise PathSyntaxError("= and a value, or a block in braces, must follow the path", max(at - 1, 0))


class Overrides:
    """Applies options, in order, to one configuration."""

    def __init__(self, config: Any, merge: Merge) -> None:
        self._config = config
        self._merge = merge

    def apply(self, options: Sequence[str]) -> str:
        """Applies the options and returns the text that diagnostics show for them, one to a line."""
        lines = [" ".join(option.split("\n")) for option in options]
        self._merge.problems.register(OPTION)
        for number, line in enumerate(lines, 1):
            _Override(Source(OPTION, line, number), self._merge).apply(self._config)
        return "\n".join(lines)


class _Override:
    """One option."""

    def __init__(self, source: Source, merge: Merge) -> None:
        self._source = source
        self._merge = merge
        self._problems = merge.problems
        self._positions = merge.positions
        self._value_start = 0

    def apply(self, config: Any) -> None:
        try:
            steps, self._value_start = split_option(self._source.text)
        except PathSyntaxError as fault:
            self._problems.error(
                "override-syntax",
                f"--set {self._source.text!r} cannot be read: {fault}.",
                self._span(fault.offset, fault.offset + 1),
                found=self._source.text,
            )
            return
        if steps[0].name == INCLUDE:
            self._problems.error(
                "override-include",
                "include cannot be set by an option.",
                self._span(steps[0].start, steps[0].end),
                path=INCLUDE,
                found=INCLUDE,
            )
            return
        self._enter(config, steps, "")

    def _enter(self, message: Any, steps: list[Step], path: str) -> None:
        """Goes down to the block that holds the last field of the path, and sets it there."""
        if message.DESCRIPTOR.full_name == ANY and not steps[0].name.startswith("type_url"):
            self._enter_any(message, steps, path)
            return
        step, *rest = steps
        info = self._field_of(message, step, path)
        if info is None:
            return
        field_path = f"{path}.{info.name}" if path else info.name
        self._leave_oneof(message, info, path)
        if not rest:
            self._set(message, info, step, path, field_path)
            return
        if info.kind is not Kind.MESSAGE:
            self._problems.error(
                "unknown-field",
                f"{info.name} is a {info.type_text} and has no fields.",
                self._span(rest[0].start, rest[0].end),
                path=field_path,
                found=rest[0].name,
                remedy=f"End the path at {info.name}.",
            )
            return
        if info.is_repeated:
            index = self._index(message, info, step, field_path)
            if index is None:
                return
            container = getattr(message, info.name)
            inner = container[index] if index < len(container) else container.add()
            field_path = f"{field_path}[{index}]"
        else:
            inner = getattr(message, info.name)
            inner.SetInParent()
        place = self._span(step.start, step.end)
        self._positions.record(field_path, place, place)
        self._enter(inner, rest, field_path)

    def _enter_any(self, message: Any, steps: list[Step], path: str) -> None:
        prefix, _, type_name = message.type_url.rpartition("/")
        found = self._merge.types.find(type_name)
        if found is None:
            step = steps[0]
            self._problems.error(
                "override-syntax",
                f"{path} has no type yet, so its fields are not known.",
                self._span(step.start, step.end),
                path=path,
                found=step.name,
                remedy="Set the whole block: --set 'PATH { [type.example.org/acme.GripperConfig] { … } }'.",
            )
            return
        inner = found()
        message.Unpack(inner)
        self._enter(inner, steps, path)
        message.Pack(inner, type_url_prefix=f"{prefix}/")

    def _field_of(self, message: Any, step: Step, path: str) -> FieldInfo | None:
        info = field_table(message.DESCRIPTOR).get(step.name)
        if info is None:
            name_end = step.start + len(step.name)
            field = Field(step.name, step.start, name_end)
            report_unknown_field(self._problems, self._source, [message.DESCRIPTOR], field, path)
            return None
        if step.key is not None and not info.is_repeated:
            self._problems.error(
                "override-index",
                f"{info.name} holds one value and takes no index.",
                self._span(step.start, step.end),
                path=f"{path}.{info.name}" if path else info.name,
                found=f"[{step.key}]",
                allowed=(info.name,),
                remedy=f"Write {info.name} without brackets.",
            )
            return None
        return info

    def _index(self, message: Any, info: FieldInfo, step: Step, path: str) -> int | None:
        """Finds the entry that a step names; one past the last adds an entry."""
        container = getattr(message, info.name)
        names = [_name_of(item) for item in container]
        if step.number is not None and step.number <= len(container) and not info.is_map:
            return step.number
        if step.key is not None and names.count(step.key) == 1 and step.key:
            return names.index(step.key)
        allowed = [
            f"{info.name}[{index}]" + (f" ({name})" if name else "") for index, name in enumerate(names)
        ]
        if step.key is None:
            message_text = f"{info.name} is a list: one of its entries must be named."
        elif names.count(step.key) > 1:
            message_text = f"{names.count(step.key)} entries of {info.name} are named {step.key}."
        else:
            count = f"{len(container)} {'entry' if len(container) == 1 else 'entries'}"
            message_text = f"{info.name} has no entry [{step.key}]; it has {count}."
        self._problems.error(
            "override-index",
            message_text,
            self._span(step.start, step.end),
            path=path,
            found=self._source.text[step.start : step.end],
            allowed=allowed,
        )
        return None

    def _leave_oneof(self, message: Any, info: FieldInfo, path: str) -> None:
        """Clears another member of the field's oneof, as protobuf does, and forgets where it stood."""
        if not info.oneof:
            return
        member = message.WhichOneof(info.oneof)
        if member is not None and member != info.name:
            message.ClearField(member)
            self._positions.discard(f"{path}.{member}" if path else member)
        self._merge.oneofs.pop((path, info.oneof), None)

    def _set(self, message: Any, info: FieldInfo, step: Step, path: str, field_path: str) -> None:
        field = self._parse(info, step)
        if field is None:
            return
        binder = Binder(self._source, self._merge)
        if step.key is None:
            message.ClearField(info.name)
            self._positions.discard(field_path)
            self._forget_oneofs(field_path)
            binder.field(message, info, field, path)
            return
        index = self._index(message, info, step, field_path)
        if index is None or field.value is None:
            return
        if isinstance(field.value, ListValue):
            self._problems.error(
                "wrong-type",
                f"{field_path}[{index}] is one entry, not a list.",
                self._span(field.value.start, field.value.end),
                path=f"{field_path}[{index}]",
                allowed=(info.type_text,),
                remedy=f"Set the whole list: --set '{field_path}=[…]'.",
            )
            return
        self._set_entry(binder, getattr(message, info.name), info, field, f"{field_path}[{index}]", index)

    def _set_entry(
        self, binder: Binder, container: Any, info: FieldInfo, field: Field, path: str, index: int
    ) -> None:
        assert field.value is not None
        self._positions.discard(path)
        self._forget_oneofs(path)
        name = self._span(field.name_start, field.name_end)
        if info.kind is not Kind.MESSAGE:
            value = binder.scalar(info, field.value, path)
            place = self._span(field.value.start, field.value.end)
            self._positions.record(path, name, place, is_broken=value is None)
            if value is not None and index < len(container):
                container[index] = value
            elif value is not None:
                container.append(value)
        elif isinstance(field.value, Block):
            self._positions.record(path, name, name)
            if index < len(container):
                container[index].Clear()
                binder.block(container[index], field.value.fields, path)
            else:
                binder.block(container.add(), field.value.fields, path)
        else:
            self._problems.error(
                "wrong-type",
                f"{info.name} is a block of fields, not one value.",
                self._span(field.value.start, field.value.end),
                path=path,
                allowed=(f"{path} {{ … }}",),
            )

    def _parse(self, info: FieldInfo, step: Step) -> Field | None:
        """Parses the value of the option as a value of the field."""
        text = self._source.text
        start = self._value_start
        raw = text[start:].strip()
        opens = "\"'[" if info.is_repeated else "\"'"
        is_block = text[start - 1] not in "=:"  # PATH { … }
        if info.kind is Kind.STRING and raw and raw[0] not in opens and not is_block:
            begin = text.index(raw, start)
            end = begin + len(raw)
            value = Scalar(ScalarKind.RAW, begin, end, [raw], [(begin, end)])
            field = Field(info.name, step.start, step.end, has_colon=True, value=value, end=end)
        else:
            before = len(self._problems)
            field = Parser(self._source, tokenize(self._source, start), self._problems).value_only()
            if field.value is None or len(self._problems) > before:
                return None
            field.name, field.name_start, field.name_end = info.name, step.start, step.end
        return field

    def _forget_oneofs(self, path: str) -> None:
        for key in [
            key for key in self._merge.oneofs if key[0] == path or key[0].startswith((f"{path}.", f"{path}["))
        ]:
            del self._merge.oneofs[key]

    def _span(self, start: int, end: int) -> Span:
        return Span(self._source, start, end)


def _name_of(item: Any) -> str:
    """The name by which an entry can be addressed: that of its node, or its own; "" for none."""
    descriptor = getattr(item, "DESCRIPTOR", None)
    if descriptor is None:
        return ""
    node = descriptor.fields_by_name.get("node")
    if node is not None and node.message_type is not None and "node_name" in node.message_type.fields_by_name:
        return str(item.node.node_name)
    for name in ("node_name", "name"):
        field = descriptor.fields_by_name.get(name)
        if field is not None and field.cpp_type == field.CPPTYPE_STRING and not field.is_repeated:
            return str(getattr(item, name))
    return ""
