"""Shaping of a deflection: dead zone and expo."""

from __future__ import annotations


def without_dead_zone(value: float, dead_zone: float) -> float:
    """Map the dead zone to 0 and stretch the rest, so the response has no step.

    Args:
        value: -1 to 1.
        dead_zone: 0 to below 1.
    """
    size = abs(value) - dead_zone
    if not size > 0.0:
        return 0.0
    share = min(size / (1.0 - dead_zone), 1.0)
    return share if value > 0 else -share


def with_expo(value: float, expo: float) -> float:
    """Make the response finer around the centre: a blend of linear and cubic.

    Args:
        value: -1 to 1.
        expo: 0 is linear, 1 is cubic.
    """
    return (1.0 - expo) * value + expo * value**3
