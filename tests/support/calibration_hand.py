"""A person's hand on an arm that is only numbers: it moves joints and feeds a procedure."""

from __future__ import annotations

from collections.abc import Mapping

from joshua_calibration.procedure import Procedure
from joshua_calibration.target import TargetMotor

PERIOD_S = 0.02


class Hand:
    """Moves the joints of a simulated arm at ``speed`` ticks a reading and feeds a procedure.

    Attributes:
        angles: true shaft angles in ticks, not wrapped.
        stops: mechanical range of each joint.
    """

    def __init__(
        self, motors: tuple[TargetMotor, ...], middles: list[int], half_ranges: list[int], speed: int = 40
    ) -> None:
        self.motors = motors
        self.angles = list(middles)
        self.stops = [(m - h, m + h) for m, h in zip(middles, half_ranges, strict=True)]
        self.time_s = 100.0
        self.speed = speed
        self.procedure = Procedure(motors)

    def raw(self) -> list[int]:
        return [a % m.ticks_per_turn for a, m in zip(self.angles, self.motors, strict=True)]

    def rest(self, readings: int = 30) -> None:
        for _ in range(readings):
            self.feed()

    def feed(self) -> None:
        self.time_s += PERIOD_S
        self.procedure.observe(self.time_s, self.raw())

    def move(self, goals: Mapping[int, int], *, feed: bool = True) -> None:
        """Moves joints to shaft angles, at most to their stops."""
        goals = {i: min(max(g, self.stops[i][0]), self.stops[i][1]) for i, g in goals.items()}
        while any(self.angles[i] != goal for i, goal in goals.items()):
            for i, goal in goals.items():
                step = min(max(goal - self.angles[i], -self.speed), self.speed)
                self.angles[i] += step
            if feed:
                self.feed()
            else:
                self.time_s += PERIOD_S

    def sweep(self, index: int, *, back_to: int | None = None) -> None:
        """Low stop, high stop, and back to where the joint was."""
        start = self.angles[index] if back_to is None else back_to
        self.move({index: -(10**6)})
        self.move({index: 10**6})
        self.move({index: start})

    def take_home(self) -> None:
        self.rest()
        self.procedure.confirm()

    def finish(self) -> None:
        """Everything from the middle pose to the review."""
        self.take_home()
        for index in range(len(self.motors)):
            self.sweep(index)
            self.procedure.confirm()
