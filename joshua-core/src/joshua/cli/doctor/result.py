"""A result of the doctor: one sentence about one thing, and the remedy."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any

from joshua.cli.exit_codes import ExitCode
from joshua.supervisor.tables import GREEN, NO_BREAK, PLAIN, RED, YELLOW, Screen


class Level(str, Enum):
    """How much a result matters."""

    OK = "ok"
    NOTE = "note"
    """Works, but could be better."""
    WARNING = "warning"
    """Works now, and may fail."""
    ERROR = "error"
    """Does not work."""


@dataclass(frozen=True)
class DoctorResult:
    """One result.

    Attributes:
        check: name of the check; subject: what it is about, such as ``/dev/ttyACM0``.
        message: what was found; remedy: what to do, "" if nothing.
        code: exit code of the command if this is an error.
    """

    level: Level
    check: str
    subject: str
    message: str
    remedy: str = ""
    code: ExitCode = ExitCode.HARDWARE


_WIDTH = max(len(level.value) for level in Level)
_STYLES = {Level.OK: GREEN, Level.WARNING: YELLOW, Level.ERROR: RED}


def lines(result: DoctorResult, screen: Screen = PLAIN) -> list[str]:
    """Lay out one result."""
    indent = " " * (_WIDTH + 2)
    inner = replace(screen, columns=max(screen.columns - len(indent), 0))
    texts = f"{result.check}: {result.subject}: {result.message}".splitlines()
    first, *rest = [line for text in texts for line in inner.wrap(text.strip())]
    label = screen.paint(f"{result.level.value:<{_WIDTH}}", _STYLES.get(result.level, ""))
    text = [f"{label}  {first}", *(f"{indent}  {line.strip()}" for line in rest)]
    if result.remedy:
        remedy = _COMMAND.sub(_copyable, f"do: {result.remedy}")
        text += [f"{indent}{line}".replace(NO_BREAK, " ") for line in inner.wrap(remedy)]
    return text


_COMMAND = re.compile("`[^`]*`")


def _copyable(command: re.Match[str]) -> str:
    """A command that is wrapped only where a shell continues with the next line."""
    return re.sub("(?<![|&]) ", NO_BREAK, command[0])


def summary(results: Sequence[DoctorResult]) -> str:
    """Count the results of each level."""
    counts = [(sum(result.level is level for result in results), level.value) for level in reversed(Level)]
    parts = [f"{count} {name}{'s' if count != 1 and name != 'ok' else ''}" for count, name in counts if count]
    return ", ".join(parts)


def as_json(result: DoctorResult) -> dict[str, Any]:
    """One result for programs."""
    return {**asdict(result), "level": result.level.value, "code": int(result.code)}


def exit_code(results: Iterable[DoctorResult]) -> ExitCode:
    """0 without errors; else that of the first obstacle to a run: the file, the plugins, the hardware."""
    codes = {result.code for result in results if result.level is Level.ERROR}
    order = (ExitCode.INVALID, ExitCode.NOT_INSTALLED, ExitCode.HARDWARE)
    return next((code for code in order if code in codes), ExitCode.OK)
