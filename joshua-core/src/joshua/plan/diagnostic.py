"""A finding about a configuration: where, what was found, what is allowed, why, what to do."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

# Plain dataclasses, because importing pydantic alone would take a third of the time limit of `joshua
# --validate-only`.


class Severity(str, Enum):
    """Severity of a finding: an error stops the run, a warning and a note do not."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Position:
    """A span within a line of a file. Line and column count from 1, columns in characters."""

    file: str
    line: int
    column: int
    length: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Related:
    """Another position related to a finding, such as the first use of a port."""

    position: Position
    label: str


@dataclass(frozen=True)
class Diagnostic:
    """One finding about a configuration.

    Attributes:
        code: stable slug, explained in the diagnostics table of the documentation.
        severity: error, warning or note.
        message: what is wrong and why, one sentence.
        position: where; None for findings about the command line.
        field_path: path such as ``robot.actions[0].node.node_name``; "" if none applies.
        found: the value found, as text; "" for none.
        allowed: allowed values, the nearest first.
        remedy: what to do next, one imperative sentence.
        related: further positions.
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


#: Passwords, tokens and keys in an address. Compiled at its first use, because a correct file has none.
_MASKED = (
    r"(?i)(?<=://)[^/\s\"@]*(?=@)|hf_\w{8,}|(?:AKIA|ASIA)[A-Z0-9]{12,}"
    r"|(?:(?<=token=)|(?<=secret=)|(?<=word=)|(?<=key=)|(?<=sig=)|(?<=ature=))[^\"&\s]+"
)


@lru_cache(maxsize=16)  # cached, because many findings may show the same long line
def masked(text: str) -> str:
    """Mask secrets in a text without changing its length."""
    return re.sub(_MASKED, lambda match: "*" * len(match[0]), text)


# Programs at the start of a remedy keep their lower case.
_PROGRAMS = ("joshua", "pip", "sudo")


def as_sentence(text: str) -> str:
    """End a message with a full stop, unless it already ends as a sentence."""
    return text if text.endswith((".", "?", "!")) else f"{text}."


def as_instruction(text: str) -> str:
    """Capitalise a remedy, unless it begins with a program's or field's name, and end it."""
    first = text.split(maxsplit=1)[0] if text else ""
    plain = first.rstrip(",;:").isalpha() and first not in _PROGRAMS
    return as_sentence(text[0].upper() + text[1:] if plain else text) if text else ""
