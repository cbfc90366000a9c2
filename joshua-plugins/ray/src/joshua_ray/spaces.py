"""What ``joshua sweep --set`` varies: fixed values and ranges."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from joshua_jobs.executor import JobError

_INVALID = 2

_SPACE = re.compile(r"([a-z]+)\((.*)\)")

#: An item of a list: commas in brackets and in quotes do not end it.
_ITEM = re.compile(r"""(?:[^,\["']|\[[^\]]*\]|"[^"]*"|'[^']*')+""")

#: Ranges, and how to write one.
KINDS = {
    "uniform": "uniform(0.9,0.999)",
    "loguniform": "loguniform(1e-4,1e-2)",
    "integer": "integer(1,10)",
    "choice": "choice(16,32,64)",
    "grid": "grid(16,32,64)",
}


@dataclass(frozen=True)
class Space:
    """The values of one field.

    Attributes:
        field: its path in the file; kind: one of ``KINDS``; ends: of a range; items: to choose from, as text.
    """

    field: str
    kind: str
    ends: tuple[float, float] = (0.0, 0.0)
    items: tuple[str, ...] = ()

    @property
    def extremes(self) -> tuple[str, ...]:
        """Return the values that a check of the file tries: all items, or both ends."""
        return self.items or tuple(as_text(end, self.kind) for end in self.ends)

    def of_tune(self, tune: Any) -> Any:
        """Return the space of Ray Tune."""
        if self.kind == "grid":
            return tune.grid_search(list(self.items))
        if self.kind == "choice":
            return tune.choice(list(self.items))
        if self.kind == "integer":
            return tune.randint(int(self.ends[0]), int(self.ends[1]) + 1)
        return getattr(tune, self.kind)(*self.ends)


def as_text(value: Any, kind: str = "") -> str:
    """Return a value as the text of ``--set``."""
    if isinstance(value, str):
        return value
    return str(int(value)) if kind == "integer" or isinstance(value, int) else repr(float(value))


def read(overrides: list[str]) -> tuple[list[str], list[Space]]:
    """Separate fixed overrides from ranges.

    Raises:
        JobError: a range is malformed, or none is given.
    """
    fixed, spaces = [], []
    for override in overrides:
        field, equals, value = override.partition("=")
        match = _SPACE.fullmatch(value.strip()) if equals else None
        if match is None or match[1] not in KINDS:
            if match is not None:
                raise _wrong(override, f"there is no range {match[1]}")
            fixed.append(override)
            continue
        spaces.append(_space(override, field.strip(), match[1], match[2]))
    if not spaces:
        raise JobError(
            "no field varies. Write a range, such as "
            "--set 'ai.training.rl_config.learning_rate=loguniform(1e-4,1e-2)'",
            _INVALID,
        )
    return fixed, spaces


def points(spaces: list[Space]) -> int:
    """Return the number of points of all grids together."""
    return math.prod(len(space.items) for space in spaces if space.kind == "grid")


def _space(override: str, field: str, kind: str, content: str) -> Space:
    items = [item.strip() for item in _ITEM.findall(content)]
    if kind in ("choice", "grid"):
        if not items:
            raise _wrong(override, "it has no value")
        return Space(field, kind, items=tuple(items))
    try:
        low, high = map(float, items)
    except ValueError:
        raise _wrong(override, "it takes two numbers") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise _wrong(override, "its first number must be below its second")
    if kind == "loguniform" and low <= 0:
        raise _wrong(override, "a logarithmic range starts above 0")
    if kind == "integer" and (low != int(low) or high != int(high)):
        raise _wrong(override, "its ends are whole numbers")
    return Space(field, kind, ends=(low, high))


def _wrong(override: str, why: str) -> JobError:
    return JobError(f"--set {override}: {why}. Write {', '.join(KINDS.values())}", _INVALID)
