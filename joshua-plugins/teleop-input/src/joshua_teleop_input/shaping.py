"""From a deflection to a share of the speed: dead zone and expo."""

from __future__ import annotations


def without_dead_zone(value: float, dead_zone: float) -> float:
    """Leave nothing of what lies in the dead zone, and stretch the rest, so that there is no step.

    Args:
        value: -1 to 1.
        dead_zone: 0 up to below 1.
    """
    size = abs(value) - dead_zone
    if not size > 0.0:
        return 0.0
    share = min(size / (1.0 - dead_zone), 1.0)
    return share if value > 0 else -share


def with_expo(value: float, expo: float) -> float:
    """Make the middle of the way gentler and leave its end: a blend of straight line and cube.

    Args:
        value: -1 to 1.
        expo: 0 is the straight line, 1 the cube.
    """
    return (1.0 - expo) * value + expo * value**3
