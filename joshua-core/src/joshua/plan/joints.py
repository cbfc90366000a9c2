"""A joint as the plan knows it, without a connection to its device."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class JointRange:
    """One joint: its name, and the ends of its range in radians."""

    name: str
    min_rad: float
    max_rad: float
