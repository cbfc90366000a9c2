"""Between the servos' ticks and the joints' radians, with the limits that hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from joshua.devices.actuator import FloatArray, JointLimits

from joshua_sts3215.registers import TICKS_PER_TURN
from joshua_sts3215.settings import Sts3215Settings

RADIANS_PER_TICK = math.tau / TICKS_PER_TURN
MAX_SPEED_TICKS_S = 3400  # the servo's own maximum, about 5.2 rad/s

TickArray = npt.NDArray[np.int64]


class JointMap:
    """Conversions of one arm; arrays have shape (N,) in joint order."""

    def __init__(self, settings: Sts3215Settings) -> None:
        self._zero = settings.zero_ticks
        self._sign = np.array([-1.0 if settings.inverted(i) else 1.0 for i in settings.motor_ids])
        ranges = np.array(settings.ranges_ticks(), dtype=np.int64)
        self.low_ticks: TickArray = ranges[:, 0]
        self.high_ticks: TickArray = ranges[:, 1]
        speed = settings.velocity_ticks_s or MAX_SPEED_TICKS_S
        self.speed_rad_s: FloatArray = np.full(
            len(settings.motor_ids), min(speed, MAX_SPEED_TICKS_S) * RADIANS_PER_TICK
        )

    def tighten(self, low: Sequence[int], high: Sequence[int]) -> None:
        """Takes the servos' own limits in ticks where they are tighter."""
        self.low_ticks = np.maximum(self.low_ticks, low)
        self.high_ticks = np.minimum(self.high_ticks, high)

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

    def ticks(self, radians: FloatArray) -> TickArray:
        """Positions in ticks of joint angles, rounded and held within the limits."""
        ticks = np.rint(self._zero + self._sign * radians / RADIANS_PER_TICK).astype(np.int64)
        return np.clip(ticks, self.low_ticks, self.high_ticks)
