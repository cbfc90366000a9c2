"""One finding about a configuration: where, what, what is allowed, why, what to do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

# Plain dataclasses, because every check of a file makes these and pydantic alone would cost a third of
# the time that `joshua --validate-only` may take.


class Severity(str, Enum):
    """How much a finding weighs: an error stops the run, a warning and a note do not."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Position:
    """A span of one line in a file; line and column count from 1, column in characters."""

    file: str
    line: int
    column: int
    length: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Related:
    """Another place that belongs to a finding, such as the first use of a port."""

    position: Position
    label: str


@dataclass(frozen=True)
class Diagnostic:
    """One finding about a configuration.

    Attributes:
        code: stable slug that the diagnostics table of the documentation explains.
        severity: how much it weighs.
        message: what is wrong and why, one sentence.
        position: where; None for findings about the command line.
        field_path: path such as ``robot.actions[0].node.node_name``; "" where none applies.
        found: what stands there, as text; "" where nothing stands there.
        allowed: what may stand there, the nearest first.
        remedy: what to do next, one imperative sentence.
        related: further places.
    """

    code: str
    severity: Severity
    message: str
    position: Position | None = None
    field_path: str = ""
    found: str = ""
    allowed: tuple[str, ...] = ()
    remedy: str = ""
    related: tuple[Related, ...] = ()
