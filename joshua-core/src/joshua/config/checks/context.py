"""What every check works with: the configuration, where its parts stand, and how findings are made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

from joshua.config.checks.blocks import Block, all_blocks
from joshua.config.names import NameFault, topic_fault
from joshua.config.topics import Endpoint, NodeEntry, endpoints, node_entries
from joshua.plan import Diagnostic, Position, Related, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.textproto.field_facts import number_text


class Positions(Protocol):
    """Where the fields of a configuration stand in its files."""

    def value(self, field_path: str, /) -> Position | None:
        """Place of a field's value; None where it is not written."""

    def name(self, field_path: str, /) -> Position | None:
        """Place of a field's name; None where it is not written."""

    def is_set(self, field_path: str, /) -> bool:
        """Whether a field is written, be it with its default value or one that could not be read."""

    def is_broken(self, field_path: str, /) -> bool:
        """Whether a field is written with a value that could not be read."""

    def paths(self) -> Iterable[str]:
        """Every path that is written."""


class Loaded(Protocol):
    """A configuration as loading returns it."""

    @property
    def config(self) -> pb.Config:
        """The merged configuration."""

    @property
    def positions(self) -> Positions:
        """Where its fields stand."""

    @property
    def diagnostics(self) -> Sequence[Diagnostic]:
        """Findings of loading."""

    @property
    def sources(self) -> Mapping[str, str]:
        """File name to text, root file first."""

    @property
    def is_readable(self) -> bool:
        """Whether the root file could be read at all."""

    @property
    def calibration_file(self) -> str:
        """The robot's calibration file, where it was loaded by itself; "" otherwise."""


class Context:
    """One configuration under check.

    Attributes:
        loaded: what loading returned; config: the merged message.
    """

    def __init__(self, loaded: Loaded) -> None:
        self.loaded = loaded
        self.config = loaded.config
        self._lines: dict[str, list[str]] = {}

    @cached_property
    def blocks(self) -> list[Block]:
        """Every block of the configuration."""
        return all_blocks(self.config)

    @cached_property
    def entries(self) -> list[NodeEntry]:
        """Every node block."""
        return list(node_entries(self.config))

    @cached_property
    def endpoints(self) -> list[Endpoint]:
        """Every publisher and subscription."""
        return endpoints(self.config)

    @cached_property
    def by_path(self) -> dict[str, Endpoint]:
        """Every publisher and subscription by its field path."""
        return {item.path: item for item in self.endpoints}

    @cached_property
    def usable(self) -> list[Endpoint]:
        """The endpoints whose topic name is valid; the others are reported by the naming rules."""
        return [
            item
            for item in self.endpoints
            if item.block.topic_name and topic_fault(item.block.topic_name) is None
        ]

    @cached_property
    def all_published(self) -> bool:
        """Whether the topic of every publisher is known; else nothing can be called unpublished."""
        return sum(item.is_publisher for item in self.usable) == sum(
            item.is_publisher for item in self.endpoints
        )

    @cached_property
    def by_topic(self) -> dict[str, list[Endpoint]]:
        """The usable endpoints of each topic."""
        return _grouped((item.topic, item) for item in self.usable)

    @cached_property
    def _by_entry(self) -> dict[str, list[Endpoint]]:
        return _grouped((item.entry.path, item) for item in self.usable)

    def of_entry(self, entry: NodeEntry) -> list[Endpoint]:
        """The usable endpoints of one node."""
        return self._by_entry.get(entry.path, [])

    @cached_property
    def published_by_nodes(self) -> dict[str, int]:
        """Topics that the nodes of the file publish, and their types."""
        return {item.topic: item.block.data_type for item in self.usable if item.is_publisher}

    @cached_property
    def published(self) -> dict[str, int]:
        """Topics that the run publishes, and their types.

        That is what its nodes name, what an actuator adds by itself, and what a replay commands.
        """
        names = dict(self.published_by_nodes)
        for entry in self.entries:
            if isinstance(entry.owner, pb.SingleAction) and entry.node.node_name:
                names.setdefault(f"{entry.full_name}/command", types.JOINT_STATE)
        replays = self.config.ai.data_store.operation == pb.DATA_STORE_REPLAY
        if replays and self.config.general.mode == pb.MODE_DATA_STORE:
            names |= {item.topic: item.block.data_type for item in self.usable if is_command(item)}
        return names

    def is_set(self, block: Block, name: str) -> bool:
        """Whether a singular field of a block is written."""
        message = block.message
        if block.has_presence(name):
            return bool(message.HasField(name))
        return bool(getattr(message, name)) or self.loaded.positions.is_set(block.field_path(name))

    def is_known(self, path: str, value: int) -> bool:
        """Whether a number is what the user wrote: set, be it to 0, and not broken."""
        positions = self.loaded.positions
        return (value != 0 or positions.is_set(path)) and not positions.is_broken(path)

    def position(self, path: str) -> Position | None:
        """Place of a field's value, else of the innermost block around it, else the start of the file."""
        positions = self.loaded.positions
        return positions.value(path) or positions.name(path) or self._enclosing(path)

    def block_position(self, path: str) -> Position | None:
        """Place of the name of a block, else of the innermost block around it."""
        positions = self.loaded.positions
        return positions.name(path) or positions.value(path) or self._enclosing(path)

    def text_at(self, position: Position | None) -> str:
        """The source text of a span; "" where it is not known."""
        if position is None or position.file not in self.loaded.sources:
            return ""
        if position.file not in self._lines:
            self._lines[position.file] = self.loaded.sources[position.file].split("\n")
        lines = self._lines[position.file]
        if not 1 <= position.line <= len(lines):
            return ""
        return lines[position.line - 1][position.column - 1 : position.column - 1 + position.length]

    def found(self, path: str, value: object) -> str:
        """The text of a value as the user wrote it, else the value itself."""
        if isinstance(value, str) and len(value) > 200:
            return f'"{value}"'
        written = self.text_at(self.loaded.positions.value(path))
        if written:
            return written
        if isinstance(value, str):
            return f'"{value}"'
        return number_text(value) if isinstance(value, float) else str(value)

    def name_position(self, path: str, value: str, fault: NameFault) -> Position | None:
        """Place of the part of a name that breaks a rule, else of the whole value."""
        place = self.position(path)
        if place is not None and self.text_at(place)[1:-1] == value:
            return replace(place, column=place.column + 1 + fault.offset, length=max(fault.length, 1))
        return place

    def see(self, path: str, label: str) -> tuple[Related, ...]:
        """A related place, for ``Diagnostic.related``; empty where the place is not known."""
        place = self.position(path)
        return () if place is None else (Related(position=place, label=label),)

    def error(self, code: str, message: str, path: str, **details: Any) -> Diagnostic:
        """Makes an error; ``details`` are further attributes of the Diagnostic."""
        return self._finding(Severity.ERROR, code, message, path, details)

    def warning(self, code: str, message: str, path: str, **details: Any) -> Diagnostic:
        """Makes a warning."""
        return self._finding(Severity.WARNING, code, message, path, details)

    def note(self, code: str, message: str, path: str, **details: Any) -> Diagnostic:
        """Makes a note."""
        return self._finding(Severity.NOTE, code, message, path, details)

    def _finding(
        self, severity: Severity, code: str, message: str, path: str, details: dict[str, Any]
    ) -> Diagnostic:
        if "position" not in details:
            details["position"] = self.position(path)
        if "remedy" in details:
            details["remedy"] = as_instruction(details["remedy"])
        return Diagnostic(
            code=code, severity=severity, message=as_sentence(message), field_path=path, **details
        )

    def _enclosing(self, path: str) -> Position | None:
        positions = self.loaded.positions
        while path:
            path = path[: path.rfind("[")] if path.endswith("]") else path.rpartition(".")[0]
            if path and (place := positions.name(path) or positions.value(path)):
                return place
        for file in self.loaded.sources:
            return Position(file=file, line=1, column=1)
        return None


def is_command(item: Endpoint) -> bool:
    """Whether an endpoint is the subscription by which an actuator is commanded."""
    return (
        not item.is_publisher
        and isinstance(item.entry.owner, pb.SingleAction)
        and item.block.data_type in (types.JOINT_STATE, types.JOINT_TRAJECTORY)
    )


def _grouped(items: Iterable[tuple[str, Endpoint]]) -> dict[str, list[Endpoint]]:
    groups: dict[str, list[Endpoint]] = {}
    for key, item in items:
        groups.setdefault(key, []).append(item)
    return groups
