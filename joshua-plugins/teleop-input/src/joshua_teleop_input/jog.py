"""Joint goals from speeds: integrated from the joint positions with a bounded lead."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

#: Lead of a goal over its joint: the motion in this time, but at least the angle.
LEAD_S = 0.3
LEAST_LEAD_RAD = 0.1

#: Age from which a joint state is stale and all motion stops.
STATE_LIMIT_S = 0.5


class Jog:
    """Goals of some joints.

    A goal moves only while its joint has a speed, and stops in the same call when the speed becomes 0.

    Args:
        joints: names of the joints that are driven.
        limits: minimum and maximum angle in rad by joint, if known.
        period_s: interval between calls of ``advance``.
    """

    def __init__(
        self, joints: Iterable[str], limits: Mapping[str, tuple[float, float]], period_s: float
    ) -> None:
        self.joints = tuple(dict.fromkeys(joints))
        self._limits = dict(limits)
        self._period_s = period_s
        self._position: dict[str, float] = {}
        self._goal: dict[str, float] = {}
        self._observed_s: dict[str, float] = {}
        self._planned_until_s: float | None = None
        self._velocity: dict[str, float] = {}

    @property
    def goal(self) -> dict[str, float]:
        """Goals in rad by joint; empty before ``begin``."""
        return dict(self._goal)

    def observe(self, position_rad: Mapping[str, float], now_s: float) -> None:
        """Update the joint positions; ``now_s`` on the monotonic clock."""
        for name, angle in position_rad.items():
            if name in self.joints and math.isfinite(angle):
                self._position[name], self._observed_s[name] = angle, now_s

    def missing(self) -> list[str]:
        """Driven joints whose position was never received."""
        return [name for name in self.joints if name not in self._position]

    def ready(self, now_s: float) -> bool:
        """Return whether every joint's position is known and recent."""
        times_s = [self._observed_s.get(name, -math.inf) for name in self.joints]
        return now_s - min(times_s, default=-math.inf) <= STATE_LIMIT_S

    def begin(self) -> None:
        """Start from the present joint positions."""
        self._goal = {name: self._position[name] for name in self.joints}
        self._velocity = {}
        self._planned_until_s = None

    def end(self) -> None:
        """Discard the goals; the next ``begin`` starts from the joint positions at that time."""
        self._goal, self._velocity = {}, {}
        self._planned_until_s = None

    def advance(self, velocity_rad_s: Mapping[str, float], now_s: float) -> dict[str, float]:
        """Advance the goals by one period and return them.

        An extra call within a period, after an input change, advances only by the elapsed part.
        """
        until_s = now_s + self._period_s
        planned_s = self._planned_until_s
        # No goal jumps after a pause or a late tick.
        missing_s = 0.0 if planned_s is None else min(max(until_s - planned_s, 0.0), 2 * self._period_s)
        for name in self.joints:
            speed = velocity_rad_s.get(name, 0.0)
            if speed != 0.0:
                # A joint at rest starts now and has no goal yet.
                elapsed_s = missing_s if self._velocity.get(name, 0.0) else self._period_s
                self._goal[name] = self._bounded(name, self._goal[name] + speed * elapsed_s, speed)
        self._velocity = dict(velocity_rad_s)
        self._planned_until_s = until_s
        return self.goal

    def _bounded(self, name: str, wanted: float, speed: float) -> float:
        """Clamp an angle to limits and lead; clamping never moves a goal against its speed."""
        low, high = self._limits.get(name, (float("-inf"), float("inf")))
        lead = max(LEAST_LEAD_RAD, abs(speed) * LEAD_S)
        here = self._goal[name]
        if speed > 0:
            return max(here, min(wanted, high, self._position[name] + lead))
        return min(here, max(wanted, low, self._position[name] - lead))
