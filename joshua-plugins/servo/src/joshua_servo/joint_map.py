"""Conversion between the servos' ticks and the joints' radians, with the effective limits.

The code of the control cycle is plain Python. For few joints it takes a third of the time of array
operations, whose code is rarely still in the processor's caches in the next cycle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
from joshua.api import FloatArray, JointLimits
from joshua.api.calibration import TICKS_PER_TURN

from joshua_servo.feedback import Feedback
from joshua_servo.settings import ServoSettings

RADIANS_PER_TICK = math.tau / TICKS_PER_TURN

TickArray = npt.NDArray[np.int64]


class JointMap:
    """Conversions of one arm; arrays have shape (N,) in joint order."""

    def __init__(self, settings: ServoSettings) -> None:
        self._zero: FloatArray = np.full(len(settings.motor_ids), settings.zero_ticks)
        self._sign = np.array([-1.0 if settings.inverted(i) else 1.0 for i in settings.motor_ids])
        ranges = np.array(settings.ranges_ticks(), dtype=np.int64)
        self.low_ticks: TickArray = ranges[:, 0]
        self.high_ticks: TickArray = ranges[:, 1]
        self.speed_rad_s: FloatArray = np.array(settings.speeds_ticks_s()) * RADIANS_PER_TICK
        self._tabulate()

    def _tabulate(self) -> None:
        """Make the rows for the control cycle: zero, radians per tick, low and high end, speed."""
        scales = self._sign * RADIANS_PER_TICK
        columns = (self._zero, scales, self.low_ticks, self.high_ticks, self.speed_rad_s)
        self._rows = list(zip(*(column.tolist() for column in columns), strict=True))

    def tighten(self, low: Sequence[int], high: Sequence[int], speed: Sequence[float] = ()) -> None:
        """Apply the servos' own limits, in ticks and ticks/s, if they are tighter."""
        self.low_ticks = np.maximum(self.low_ticks, low)
        self.high_ticks = np.minimum(self.high_ticks, high)
        if speed:
            self.speed_rad_s = np.minimum(self.speed_rad_s, np.array(speed) * RADIANS_PER_TICK)
        self._tabulate()

    def follow_turns(self, ticks: Sequence[int], counts_turns: Sequence[bool]) -> None:
        """For servos that count turns, shift positions to the turn nearest to the joint's range.

        After a power cut, such a servo may be whole turns away from its calibration.
        """
        middle = (self.low_ticks + self.high_ticks) / 2
        turns = np.rint((np.asarray(ticks) - middle) / TICKS_PER_TURN).astype(np.int64)
        shift = np.where(counts_turns, turns, 0) * TICKS_PER_TURN
        self._zero = self._zero + shift
        self.low_ticks = self.low_ticks + shift
        self.high_ticks = self.high_ticks + shift
        self._tabulate()

    def limits(self) -> JointLimits:
        """The effective limits in radians."""
        ends = np.stack((self.radians(self.low_ticks), self.radians(self.high_ticks)))
        return JointLimits(ends.min(axis=0), ends.max(axis=0), self.speed_rad_s.copy())

    def radians(self, ticks: Iterable[float]) -> FloatArray:
        """Joint angles of positions in ticks."""
        return np.array([(tick - row[0]) * row[1] for tick, row in zip(ticks, self._rows, strict=True)])

    def motion(self, readings: Sequence[Feedback]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Joint angles, speeds and loads."""
        position, speed, load = [], [], []
        for reading, (zero, scale, *_) in zip(readings, self._rows, strict=True):
            position.append((reading.position - zero) * scale)
            speed.append(reading.speed * scale)
            load.append(reading.load if scale > 0 else -reading.load)
        return np.array(position), np.array(speed), np.array(load)

    def limited(self, goal: Iterable[float], last: Iterable[float], elapsed_s: float) -> list[float]:
        """Joint angles limited to the distance from the last ones that the speeds allow in a time."""
        return [
            min(max(value, before - row[4] * elapsed_s), before + row[4] * elapsed_s)
            for value, before, row in zip(goal, last, self._rows, strict=True)
        ]

    def ticks(self, radians: Iterable[float], last: Sequence[int] | None = None) -> list[int]:
        """Positions in ticks of joint angles, rounded and limited.

        Args:
            last: the previous goals. A joint beyond a limit stays there until it is commanded back, at the
                commanded speed.
        """
        ticks = []
        for index, (value, (zero, scale, low, high, _)) in enumerate(zip(radians, self._rows, strict=True)):
            if last is not None:
                low, high = min(low, last[index]), max(high, last[index])
            ticks.append(min(max(round(zero + value / scale), low), high))
        return ticks
