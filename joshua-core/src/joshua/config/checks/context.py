"""What every check works with: the configuration, where its parts stand, and how findings are made."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from joshua.config.checks.blocks import Block, all_blocks
from joshua.config.names import NameFault
from joshua.plan import Diagnostic, Position, Related, Severity
from joshua.plan.diagnostic import as_instruction, as_sentence

if TYPE_CHECKING:
    from joshua.config.loading import LoadedConfig


class Context:
    """One configuration under check, and the maker of diagnostics about it.

    Attributes:
        loaded: what loading returned; config: the merged message; graph: its nodes and topics.
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
        """Whether a number is what the user wrote: set, be it to 0, and not broken."""
        positions = self.loaded.positions
        return (value != 0 or positions.is_set(path)) and not positions.is_broken(path)

    def position(self, path: str) -> Position | None:
        """Position of a field's value or a block's name, else of the block around it, else of the file."""
        place = self.loaded.positions.nearest(path)
        if place is None and path:
            place = next((Position(file, 1, 1) for file in self.loaded.sources), None)
        return place

    def found(self, path: str) -> str:
        """The value of a field as the user wrote it; "" for a block and for a field that is not written."""
        entry = self.loaded.positions.entry(path)
        if entry is None or entry.value == entry.name:
            return ""
        return entry.value.source.text[entry.value.start : entry.value.end].partition("\n")[0]

    def name_position(self, path: str, value: str, fault: NameFault) -> Position | None:
        """Position of the part of a name that breaks a rule, else of the whole value."""
        place = self.position(path)
        if place is not None and self.found(path)[1:-1] == value:
            return replace(place, column=place.column + 1 + fault.offset, length=max(fault.length, 1))
        return place

    def see(self, path: str, label: str) -> tuple[Related, ...]:
        """A related position, for ``Diagnostic.related``; empty where none is known."""
        place = self.position(path)
        return () if place is None else (Related(place, label),)

    def error(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make an error about a field.

        Args:
            details: further attributes of the Diagnostic. Position and ``found`` are those of the field
                unless given, the remedy is that of the code's table row.
        """
        return self._make(Severity.ERROR, code, message, path, details)

    def warning(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make a warning, with the arguments of ``error``."""
        return self._make(Severity.WARNING, code, message, path, details)

    def note(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make a note, with the arguments of ``error``."""
        return self._make(Severity.NOTE, code, message, path, details)

    def missing(self, code: str, message: str, path: str = "", **details: Any) -> Diagnostic:
        """Make an error about what a run needs, with the arguments of ``error``; a note without a launch."""
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

    return CODES[code].next_step if code in CODES else ""  # a mode of a plugin has codes of its own
