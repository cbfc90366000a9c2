"""The commands in the documentation, as a reader would type them, and how to run them.

Commands stand in fenced blocks: ``console`` (lines after ``$``; the rest is output) and ``bash`` (a script).
A comment before a block, invisible on the page, says what a test must know::

    <!-- test: exit 2 -->                       the last command of the block ends with that code
    <!-- test: background until TEXT -->        the block runs on; go on once it has printed TEXT
    <!-- test: needs REASON; instead: COMMAND -->  this machine lacks something: run COMMAND in its place

``<!-- test: interrupt -->`` on a line of its own stands for Ctrl-C in the terminal of the background block.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_PIECE = re.compile(
    r"(?:^<!-- test: (?P<mark>[^\n]*?) -->\n)?^```(?P<language>console|bash)\n(?P<body>.*?)^```$"
    r"|^<!-- test: (?P<lone>[^\n]*?) -->$",
    re.DOTALL | re.MULTILINE,
)
_NEEDS = re.compile(r"needs (?P<reason>[^;]+); instead: (?P<command>.+)")


@dataclass(frozen=True)
class Step:
    """One thing that a test does for a page.

    Attributes:
        line: where it stands on the page.
        commands: shell commands, one after the other; empty for Ctrl-C.
        exit_code: of the last command.
        until: text that a background block prints when it is ready; "" runs in the foreground.
        interrupt: Ctrl-C in the background block's terminal.
        reason: why another command runs in its place; "" where it is the one of the page.
    """

    line: int
    commands: tuple[str, ...] = ()
    exit_code: int = 0
    until: str = ""
    interrupt: bool = False
    reason: str = ""


def steps(page: Path) -> list[Step]:
    """Reads the steps of a page.

    Raises:
        ValueError: a mark that is none of the known ones.
    """
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _PIECE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["lone"] is not None:
            if match["lone"] != "interrupt":
                raise ValueError(f"{page}:{line}: unknown mark {match['lone']!r}")
            found.append(Step(line, interrupt=True))
        else:
            found.append(
                _block(f"{page}:{line}", line, match["language"], match["body"], match["mark"] or "")
            )
    return found


def _block(place: str, line: int, language: str, body: str, mark: str) -> Step:
    commands = (body,) if language == "bash" else _typed(body)
    if not mark:
        return Step(line, commands)
    if match := re.fullmatch(r"exit (\d+)", mark):
        return Step(line, commands, exit_code=int(match[1]))
    if match := re.fullmatch(r"background until (.+)", mark):
        return Step(line, commands, until=match[1])
    if match := _NEEDS.fullmatch(mark):
        return Step(line, (match["command"],), reason=match["reason"])
    raise ValueError(f"{place}: unknown mark {mark!r}")


def _typed(body: str) -> tuple[str, ...]:
    """The commands of a console block; a backslash at the end of a line continues it."""
    joined = body.replace("\\\n", " ")
    return tuple(line.removeprefix("$ ") for line in joined.splitlines() if line.startswith("$ "))
