"""One finding about a configuration: where, what, what is allowed, why, what to do."""

from __future__ import annotations

from enum import Enum

from pydantic import BaseModel, ConfigDict


class Severity(str, Enum):
    """How much a finding weighs: an error stops the run, a warning and a note do not."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Position(BaseModel):
    """A span of one line in a file; line and column count from 1, column in characters."""

    model_config = ConfigDict(frozen=True)

    file: str
    line: int
    column: int
    length: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


class Related(BaseModel):
    """Another place that belongs to a finding, such as the first use of a port."""

    model_config = ConfigDict(frozen=True)

    position: Position
    label: str


class Diagnostic(BaseModel):
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

    model_config = ConfigDict(frozen=True)

    code: str
    severity: Severity
    message: str
    position: Position | None = None
    field_path: str = ""
    found: str = ""
    allowed: tuple[str, ...] = ()
    remedy: str = ""
    related: tuple[Related, ...] = ()
