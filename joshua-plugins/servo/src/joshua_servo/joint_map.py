"""Between the servos' ticks and the joints' radians, with the limits that hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from joshua.api import FloatArray, JointLimits
from joshua.api.calibration import TICKS_PER_TURN

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

    def tighten(self, low: Sequence[int], high: Sequence[int], speed: Sequence[float] = ()) -> None:
        """Takes the servos' own limits, in ticks and ticks/s, where they are tighter."""
        self.low_ticks = np.maximum(self.low_ticks, low)
        self.high_ticks = np.minimum(self.high_ticks, high)
        if speed:
            self.speed_rad_s = np.minimum(self.speed_rad_s, np.array(speed) * RADIANS_PER_TICK)

    def follow_turns(self, ticks: Sequence[int], counts_turns: Sequence[bool]) -> None:
        """Takes positions for those of the nearest turn to the joint's range, where a servo counts turns.

        A servo that counts turns starts anywhere after a power cut, whole turns away from its calibration.
        """
        middle = (self.low_ticks + self.high_ticks) / 2
        turns = np.rint((np.asarray(ticks) - middle) / TICKS_PER_TURN).astype(np.int64)
        shift = np.where(counts_turns, turns, 0) * TICKS_PER_TURN
        self._zero = self._zero + shift
        self.low_ticks = self.low_ticks + shift
        self.high_ticks = self.high_ticks + shift

    def limits(self) -> JointLimits:
        """The limits in force, in radians."""
        ends = self.radians(np.stack((self.low_ticks, self.high_ticks)))
        return JointLimits(ends.min(axis=0), ends.max(axis=0), self.speed_rad_s.copy())

    def radians(self, ticks: npt.ArrayLike) -> FloatArray:
        """Joint angles of positions in ticks."""
        return self.directed(np.asarray(ticks, dtype=np.float64) - self._zero) * RADIANS_PER_TICK

    def radians_per_second(self, ticks_per_second: npt.ArrayLike) -> FloatArray:
        """Joint speeds of motor speeds."""
        return self.directed(ticks_per_second) * RADIANS_PER_TICK

    def directed(self, values: npt.ArrayLike) -> FloatArray:
        """Values of the motors' directions in the joints' directions."""
        directed: FloatArray = np.asarray(values, dtype=np.float64) * self._sign
        return directed

    def ticks(self, radians: FloatArray, last: TickArray | None = None) -> TickArray:
        """Positions in ticks of joint angles, rounded and held within the limits.

        Args:
            last: the goals before; a joint that was found beyond a limit stays there until it is told to come
                back, and then comes as slowly as it is told.
        """
        ticks = np.rint(self._zero + self._sign * radians / RADIANS_PER_TICK).astype(np.int64)
        if last is None:
            return np.clip(ticks, self.low_ticks, self.high_ticks)
        return np.clip(ticks, np.minimum(self.low_ticks, last), np.maximum(self.high_ticks, last))
