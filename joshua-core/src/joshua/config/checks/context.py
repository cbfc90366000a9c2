"""The tools of every check: the configuration, positions of its parts, and constructors of findings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from google.protobuf.message import DecodeError, Message

from joshua.config.names import NameFault
from joshua.plan import Diagnostic, Position, Related, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence
from joshua.textproto.field_facts import FieldFacts, field_facts

if TYPE_CHECKING:
    from joshua.config.loading import LoadedConfig


_ANY = "google.protobuf.Any"


class Block(NamedTuple):
    """One message of the configuration.

    Attributes:
        path: field path; "" for the whole configuration.
        message: the message; for an ``Any`` block, the message inside it.
        facts: schema facts of its fields.
    """

    path: str
    message: Any
    facts: tuple[FieldFacts, ...]

    def has_presence(self, name: str) -> bool:
        """Whether a field of this block distinguishes unset from default."""
        return next(facts.has_presence for facts in self.facts if facts.name == name)

    def field_path(self, name: str) -> str:
        """Path of a field of this block."""
        return f"{self.path}.{name}" if self.path else name


def all_blocks(config: Message) -> list[Block]:
    """List the configuration and every block inside it, outer blocks first, in the order of the schema."""
    found: list[Block] = []
    waiting = [Block("", config, field_facts(config.DESCRIPTOR))]
    while waiting:
        block = waiting.pop()
        found.append(block)
        waiting.extend(reversed(list(_inner(block))))
    return found


def _inner(block: Block) -> Iterator[Block]:
    for facts in block.facts:
        if not facts.is_message:
            continue
        path = block.field_path(facts.name)
        if facts.repeated:
            children = [(f"{path}[{i}]", item) for i, item in enumerate(getattr(block.message, facts.name))]
        elif block.message.HasField(facts.name):
            children = [(path, getattr(block.message, facts.name))]
        else:
            continue
        for child_path, child in children:
            message = unpacked(child) if facts.message_type.full_name == _ANY else child
            if message is not None:
                yield Block(child_path, message, field_facts(message.DESCRIPTOR))


def unpacked(block: Any) -> Message | None:
    """Return the message inside an ``Any`` block, or None if its type is not registered."""
    from google.protobuf import descriptor_pool, message_factory

    name = block.type_url.rpartition("/")[2]
    try:
        descriptor = descriptor_pool.Default().FindMessageTypeByName(name)
        message: Message = message_factory.GetMessageClass(descriptor)()
        message.ParseFromString(block.value)
    except (KeyError, DecodeError):
        return None  # loading has reported the unknown type
    return message


class Context:
    """A configuration under check, with constructors of diagnostics.

    Attributes:
        loaded: the result of loading; config: the merged message; graph: its nodes and topics.
        launch: nodes are about to be started.
    """

    def __init__(self, loaded: LoadedConfig, *, launch: bool = False) -> None:
        self.loaded, self.launch = loaded, launch
        self.config, self.graph = loaded.config, loaded.graph

    @cached_property
    def blocks(self) -> list[Block]:
        """Every block of the configuration."""
        return all_blocks(self.config)

    def is_set(self, block: Block, name: str) -> bool:
        """Whether a singular field of a block is written."""
        message = block.message
        if block.has_presence(name):
            return bool(message.HasField(name))
        return bool(getattr(message, name)) or self.loaded.positions.is_set(block.field_path(name))

    def is_known(self, path: str, value: int) -> bool:
        """Whether a number was set by the user, including 0, and is not broken."""
        positions = self.loaded.positions
        return (value != 0 or positions.is_set(path)) and not positions.is_broken(path)

    def position(self, path: str) -> Position | None:
        """Position of a field's value or a block's name, else of the enclosing block, else of the file."""
        place = self.loaded.positions.nearest(path)
        if place is None and path:
            place = next((Position(file, 1, 1) for file in self.loaded.sources), None)
        return place

    def found(self, path: str) -> str:
        """The value of a field as the user wrote it; "" for a block and for an unset field."""
        entry = self.loaded.positions.entry(path)
        if entry is None or entry.value == entry.name:
            return ""
        return entry.value.source.text[entry.value.start : entry.value.end].partition("\n")[0]

    def name_position(self, path: str, value: str, fault: NameFault) -> Position | None:
        """Position of the invalid part of a name, else of the whole value."""
        place = self.position(path)
        if place is not None and self.found(path)[1:-1] == value:
            return replace(place, column=place.column + 1 + fault.offset, length=max(fault.length, 1))
        return place

    def see(self, path: str, label: str) -> tuple[Related, ...]:
        """A related position, for ``Diagnostic.related``; empty if unknown."""
        place = self.position(path)
        return () if place is None else (Related(place, label),)

    def error(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make an error about a field.

        Args:
            details: further attributes of the Diagnostic. Position and ``found`` default to those of the
                field, the remedy to the one in the code table.
        """
        return self._make(Severity.ERROR, code, message, path, details)

    def warning(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make a warning, with the arguments of ``error``."""
        return self._make(Severity.WARNING, code, message, path, details)

    def note(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make a note, with the arguments of ``error``."""
        return self._make(Severity.NOTE, code, message, path, details)

    def missing(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make an error about something that a run needs, a note without a launch. Arguments as ``error``."""
        severity = Severity.ERROR if self.launch else Severity.NOTE
        return self._make(severity, code, message, path, details)

    def _make(
        self, severity: Severity, code: str, message: str, path: str, details: dict[str, Any]
    ) -> Diagnostic:
        given = {"position": self.position(path), "found": self.found(path), **details}
        given["remedy"] = as_instruction(given.get("remedy") or _next_step(code))
        return Diagnostic(code, severity, as_sentence(message), field_path=path, **given)


def _next_step(code: str) -> str:
    from joshua.config.codes import CODES

    return CODES[code].next_step if code in CODES else ""  # the mode of a plugin has its own codes
