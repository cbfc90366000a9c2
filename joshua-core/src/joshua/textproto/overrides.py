"""Applies the ``--set`` options to a merged configuration. Each replaces the value of its field."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

from joshua.schema.descriptors import is_repeated
from joshua.textproto.binder import INCLUDE, Binder, Merge
from joshua.textproto.field_table import ANY, FieldInfo, Kind, field_table
from joshua.textproto.lexer import tokenize
from joshua.textproto.parser import Parser
from joshua.textproto.source import Source, Span
from joshua.textproto.syntax import Field, ListValue, Scalar, ScalarKind
from joshua.textproto.unknown_field import report_unknown_field

if TYPE_CHECKING:
    from collections.abc import Sequence

OPTION = "--set"

_STEP = re.compile(
    r"\s*([A-Za-z_]\w*)\s*(?:\[\s*(?:\"([^\"\]]*)\"|'([^'\]]*)'|([^\]\"'=:{]*?))\s*\])?\s*", re.ASCII
)


class Step(NamedTuple):
    """One field of a path, with its offsets in the option. ``key`` is the text in brackets, if any."""

    name: str
    key: str | None
    start: int
    end: int


class PathSyntaxError(ValueError):
    """An invalid path. ``offset`` is the position of the error."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


def split_option(text: str) -> tuple[list[Step], int]:
    """Split an option into its path and the offset of its value.

    Raises:
        PathSyntaxError: if the option is not of the form ``PATH=VALUE`` or ``PATH { … }``.
    """
    steps: list[Step] = []
    at = 0
    while True:
        match = _STEP.match(text, at)
        if match is None:
            raise PathSyntaxError("expected a field name here", min(at, max(len(text) - 1, 0)))
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
            raise PathSyntaxError(
                "expected = and a value, or a block in braces, after the path", max(at - 1, 0)
            )


def apply_overrides(options: Sequence[str], config: Any, merge: Merge) -> str:
    """Apply options in order to a configuration. Return their text for diagnostics."""
    lines = [" ".join(option.split("\n")) for option in options]
    merge.problems.register(OPTION)
    for number, line in enumerate(lines, 1):
        _Override(Source(OPTION, line, number), merge).apply(config)
    return "\n".join(lines)


class _Override:
    """One option."""

    def __init__(self, source: Source, merge: Merge) -> None:
        self._source = source
        self._merge = merge
        self._positions = merge.positions
        self._value_start = 0

    def apply(self, config: Any) -> None:
        text = self._source.text
        try:
            steps, self._value_start = split_option(text)
        except PathSyntaxError as fault:
            at = Step("", None, fault.offset, fault.offset + 1)
            self._error("override-syntax", f"--set {text!r} cannot be read: {fault}.", at, "", found=text)
            return
        if steps[0].name == INCLUDE:
            message = "include cannot be set with --set."
            self._error("override-include", message, steps[0], INCLUDE, found=INCLUDE)
            return
        self._enter(config, steps, "")

    def _error(self, code: str, message: str, at: Step, path: str, **details: Any) -> None:
        self._merge.problems.error(code, message, self._span(at), path=path, **details)

    def _span(self, step: Step) -> Span:
        return Span(self._source, step.start, step.end)

    def _enter(self, message: Any, steps: list[Step], path: str) -> None:
        """Descends to the block of the path's last field, and sets it there."""
        step, *rest = steps
        if message.DESCRIPTOR.full_name == ANY and not step.name.startswith("type_url"):
            self._enter_any(message, steps, path)
            return
        info = self._field_of(message, step, path)
        if info is None:
            return
        field_path = f"{path}.{info.name}" if path else info.name
        self._leave_oneof(message, info, path)
        if not rest:
            self._set(message, info, step, path, field_path)
            return
        if info.kind is not Kind.MESSAGE:
            text = f"{info.name} is a {info.type_text} and has no fields."
            remedy = f"End the path at {info.name}."
            self._error("unknown-field", text, rest[0], field_path, found=rest[0].name, remedy=remedy)
            return
        inner = getattr(message, info.name)
        if info.is_repeated:
            index = self._index(inner, info, step, field_path)
            if index is None:
                return
            inner = inner[index] if index < len(inner) else inner.add()
            field_path = f"{field_path}[{index}]"
        else:
            inner.SetInParent()
        self._positions.record(field_path, self._span(step), self._span(step))
        self._enter(inner, rest, field_path)

    def _enter_any(self, message: Any, steps: list[Step], path: str) -> None:
        prefix, _, type_name = message.type_url.rpartition("/")
        found = self._merge.types.find(type_name)
        if found is None:
            text = f"{path} has no type yet, so its fields are not known."
            remedy = "Set the whole block: --set 'PATH { [type.example.org/acme.GripperConfig] { … } }'."
            self._error("override-syntax", text, steps[0], path, found=steps[0].name, remedy=remedy)
            return
        inner = found()
        message.Unpack(inner)
        self._enter(inner, steps, path)
        message.Pack(inner, type_url_prefix=f"{prefix}/")

    def _field_of(self, message: Any, step: Step, path: str) -> FieldInfo | None:
        info = field_table(message.DESCRIPTOR).get(step.name)
        if info is None:
            field = Field(step.name, step.start, step.start + len(step.name))
            report_unknown_field(self._merge.problems, self._source, [message.DESCRIPTOR], field, path)
            return None
        if step.key is not None and not info.is_repeated:
            self._error(
                "override-index",
                f"{info.name} has a single value and takes no index.",
                step,
                f"{path}.{info.name}" if path else info.name,
                found=f"[{step.key}]",
                allowed=(info.name,),
                remedy=f"Write {info.name} without brackets.",
            )
            return None
        return info

    def _index(self, container: Any, info: FieldInfo, step: Step, path: str) -> int | None:
        """Finds the entry of a step. An index one past the last adds an entry."""
        names = [_name_of(item) for item in container]
        key = step.key
        is_number = key is not None and key.isascii() and key.isdigit() and len(key) < 10
        if key and is_number and int(key) <= len(container) and not info.is_map:
            return int(key)
        if key and names.count(key) == 1:
            return names.index(key)
        if key is None:
            text = f"{info.name} is a list. Name one of its entries."
        elif names.count(key) > 1:
            text = f"{names.count(key)} entries of {info.name} are named {key}."
        else:
            count = f"{len(container)} {'entry' if len(container) == 1 else 'entries'}"
            text = f"{info.name} has no entry [{key}]; it has {count}."
        allowed = [f"{info.name}[{at}]" + (f" ({name})" if name else "") for at, name in enumerate(names)]
        self._error("override-index", text, step, path, allowed=allowed)
        return None

    def _leave_oneof(self, message: Any, info: FieldInfo, path: str) -> None:
        """Clears another member of the field's oneof, as protobuf does, and its positions."""
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
            self._forget(field_path)
            binder.field(message, info, field, path)
            return
        container = getattr(message, info.name)
        index = self._index(container, info, step, field_path)
        value = field.value
        if index is None or value is None:
            return
        entry_path = f"{field_path}[{index}]"
        place = Step("", None, value.start, value.end)
        if isinstance(value, ListValue):
            text = f"{entry_path} is one entry, not a list."
            remedy = f"Set the whole list: --set '{field_path}=[…]'."
            self._error("wrong-type", text, place, entry_path, allowed=(info.type_text,), remedy=remedy)
            return
        self._forget(entry_path)
        name = self._span(step)
        if not binder.entry(container, index, info, value, entry_path, name, name):
            self._positions.record(entry_path, name, self._span(place), is_broken=True)

    def _parse(self, info: FieldInfo, step: Step) -> Field | None:
        """Parses the option's value as a value of the field."""
        text = self._source.text
        start = self._value_start
        raw = text[start:].strip()
        opens = "\"'[" if info.is_repeated else "\"'"
        is_block = text[start - 1] not in "=:"  # PATH { … }
        if info.kind is Kind.STRING and raw and raw[0] not in opens and not is_block:
            begin = text.index(raw, start)
            end = begin + len(raw)
            field = Field("", 0, 0)
            field.has_colon, field.end = True, end
            field.value = Scalar(ScalarKind.RAW, begin, end, [raw], [(begin, end)])
        else:
            problems = self._merge.problems
            before = len(problems)
            field = Parser(self._source, tokenize(self._source, start), problems).value_only()
            if field.value is None or len(problems) > before:
                return None
        field.name, field.name_start, field.name_end = info.name, step.start, step.end
        return field

    def _forget(self, path: str) -> None:
        """Clears the records of a field and all below it."""
        self._positions.discard(path)
        inside = (f"{path}.", f"{path}[")
        for key in [key for key in self._merge.oneofs if key[0] == path or key[0].startswith(inside)]:
            del self._merge.oneofs[key]


def _name_of(item: Any) -> str:
    """The name that addresses an entry: that of its node, or its own; "" for none."""
    known = item.DESCRIPTOR.fields_by_name if hasattr(item, "DESCRIPTOR") else {}
    node = known.get("node")
    if node is not None and node.message_type is not None and "node_name" in node.message_type.fields_by_name:
        return str(item.node.node_name)
    for name in ("node_name", "name"):
        field = known.get(name)
        if field is not None and field.cpp_type == field.CPPTYPE_STRING and not is_repeated(field):
            return str(getattr(item, name))
    return ""
