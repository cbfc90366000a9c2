"""A joint in the plan, known without a connection to its device."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class JointRange:
    """A joint: its name and its range in radians."""

    name: str
    min_rad: float
    max_rad: float
