"""The path of a ``--set`` option: field names with an index or the name of a node in brackets."""

from __future__ import annotations

import re
from typing import NamedTuple

_STEP = re.compile(
    r"\s*([A-Za-z_]\w*)\s*(?:\[\s*(?:\"([^\"\]]*)\"|'([^'\]]*)'|([^\]\"'=:{]*?))\s*\])?\s*", re.ASCII
)


class Step(NamedTuple):
    """One field of a path.

    Attributes:
        key: what stands in brackets; None where no brackets stand.
        start, end: offsets of the step in the option.
    """

    name: str
    key: str | None
    start: int
    end: int

    @property
    def number(self) -> int | None:
        """The index in the brackets; None where they hold a name."""
        if self.key is None or not self.key.isascii() or not self.key.isdigit() or len(self.key) > 9:
            return None
        return int(self.key)


class PathSyntaxError(ValueError):
    """A path that cannot be read; ``offset`` is where."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


def split_option(text: str) -> tuple[list[Step], int]:
    """Splits an option into its path and the offset at which the value begins.

    Raises:
        PathSyntaxError: if the option is not of the form ``PATH=VALUE`` or ``PATH { … }``.
    """
    steps: list[Step] = []
    at = 0
    while True:
        match = _STEP.match(text, at)
        if match is None:
            raise PathSyntaxError("a field name is expected here", min(at, max(len(text) - 1, 0)))
        key = next((found for found in match.groups()[1:] if found is not None), None)
        steps.append(Step(match[1], key, match.start(1), len(text[: match.end()].rstrip())))
        at = match.end()
        sign = text[at : at + 1]
        if sign == ".":
            at += 1
        elif sign in ("=", ":"):
            return steps, at + 1
        elif sign in ("{", "<"):
            return steps, at
        else:
            raise PathSyntaxError("= and a value, or a block in braces, must follow the path", max(at - 1, 0))
