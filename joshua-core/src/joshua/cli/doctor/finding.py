"""What the doctor finds: one sentence about one thing, and the remedy."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from joshua.cli.exit_codes import ExitCode


class Level(str, Enum):
    """How much a finding matters."""

    OK = "ok"
    NOTE = "note"
    """Works, and could be better."""
    WARNING = "warning"
    """Works now, and may fail."""
    ERROR = "error"
    """Does not work."""


@dataclass(frozen=True)
class Finding:
    """One finding.

    Attributes:
        check: name of the check; subject: what it is about, such as ``/dev/ttyACM0``.
        message: what was found; remedy: what to do, "" where nothing is to be done.
        code: exit code of the command where this is an error.
    """

    level: Level
    check: str
    subject: str
    message: str
    remedy: str = ""
    code: ExitCode = ExitCode.HARDWARE
