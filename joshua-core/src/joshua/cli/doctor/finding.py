"""What the doctor finds: one sentence about one thing, and the remedy; as text, JSON and an exit code."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

from joshua.cli.exit_codes import ExitCode
from joshua.supervisor.tables import clean


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


_WIDTH = max(len(level.value) for level in Level)


def lines(finding: Finding) -> list[str]:
    """One finding."""
    first, *rest = finding.message.splitlines() or [""]
    indentation = " " * (_WIDTH + 2)
    text = [f"{finding.level.value:<{_WIDTH}}  {finding.check}: {finding.subject}: {first}"]
    text += [f"{indentation}  {line.strip()}" for line in rest]
    if finding.remedy:
        text.append(f"{indentation}do: {finding.remedy}")
    return [clean(line) for line in text]


def summary(findings: Sequence[Finding]) -> str:
    """How many of each level."""
    counts = [(sum(finding.level is level for finding in findings), level.value) for level in reversed(Level)]
    parts = [f"{count} {name}{'s' if count != 1 and name != 'ok' else ''}" for count, name in counts if count]
    return ", ".join(parts)


def as_json(finding: Finding) -> dict[str, Any]:
    """One finding for programs."""
    return {**asdict(finding), "level": finding.level.value, "code": int(finding.code)}


def exit_code(findings: Iterable[Finding]) -> ExitCode:
    """0 without errors; else what comes first in the way to a run: the file, the plugins, the hardware."""
    codes = {finding.code for finding in findings if finding.level is Level.ERROR}
    order = (ExitCode.INVALID, ExitCode.NOT_INSTALLED, ExitCode.HARDWARE)
    return next((code for code in order if code in codes), ExitCode.OK)
