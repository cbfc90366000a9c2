"""One finding about a configuration: where, what, what is allowed, why, what to do."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

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


#: Passwords, tokens and keys in an address.
_SECRET = re.compile(
    r"(?<=://)[^/\s\"@]*(?=@)|hf_\w{8,}|(?:AKIA|ASIA)[A-Z0-9]{12,}"
    r"|(?:(?<=token=)|(?<=secret=)|(?<=word=)|(?<=key=)|(?<=sig=)|(?<=ature=))[^\"&\s]+",
    re.IGNORECASE,
)


@lru_cache(maxsize=16)  # findings on one long line show it a thousand times
def masked(text: str) -> str:
    """A text without secrets, equally long."""
    return _SECRET.sub(lambda match: "*" * len(match[0]), text)


# Programs that a remedy may begin with: they keep their lower case.
_PROGRAMS = ("joshua", "pip", "sudo")


def as_sentence(text: str) -> str:
    """Ends a message with a full stop, unless it ends as a sentence already."""
    return text if text.endswith((".", "?", "!")) else f"{text}."


def as_instruction(text: str) -> str:
    """Begins a remedy with a capital letter, unless with a program's or a field's name, and ends it."""
    first = text.split(maxsplit=1)[0] if text else ""
    plain = first.rstrip(",;:").isalpha() and first not in _PROGRAMS
    return as_sentence(text[0].upper() + text[1:] if plain else text) if text else ""
