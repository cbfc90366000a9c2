"""What every check works with: the configuration, where its parts stand, and how findings are made."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from joshua.config.checks.blocks import Block, all_blocks
from joshua.config.names import NameFault
from joshua.plan import Diagnostic, Position, Related, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence
from joshua.textproto.field_facts import number_text

if TYPE_CHECKING:
    from joshua.config.loading import LoadedConfig


class Context:
    """One configuration under check.

    Attributes:
        loaded: what loading returned; config: the merged message; graph: of its nodes and topics.
    """

    def __init__(self, loaded: LoadedConfig) -> None:
        self.loaded = loaded
        self.config = loaded.config
        self.graph = loaded.graph
        self._lines: dict[str, list[str]] = {}

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
