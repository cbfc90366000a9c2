"""Conversion between the hub's degrees and the joints' radians, with limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from joshua.api import FloatArray

from joshua_spike.settings import MIDDLE_TICK, TICKS_PER_TURN, SpikeSettings

RADIANS_PER_DEGREE = math.tau / 360
#: Top speed of the slowest LEGO motor with an absolute encoder.
MAX_SPEED_RAD_S = 620.0 * RADIANS_PER_DEGREE


class JointMap:
    """Conversions of one hub; arrays have shape (N,) in joint order.

    Args:
        settings: of the driver.
        angles_deg: present motor angles; select the turn so that each joint starts within half a turn of its
            zero.
    """

    def __init__(self, settings: SpikeSettings, angles_deg: Sequence[int] | None = None) -> None:
        motors = [settings.motor(port) for port in settings.port_names]
        self._sign = np.array([-1.0 if motor and motor.inverted else 1.0 for motor in motors])
        zero_ticks = [MIDDLE_TICK + (motor.homing_offset if motor else -MIDDLE_TICK) for motor in motors]
        zero_deg = np.array(zero_ticks, dtype=np.float64) * 360 / TICKS_PER_TURN
        if angles_deg is not None:
            zero_deg += 360 * np.floor((np.array(angles_deg) - zero_deg + 180) / 360)
        self._zero_deg = zero_deg
        ranges = np.array([settings.range_rad(port) for port in settings.port_names])
        self._low_rad, self._high_rad = ranges[:, 0], ranges[:, 1]

    def radians(self, angles_deg: Sequence[int]) -> FloatArray:
        """Convert motor angles to joint angles."""
        return self.directed(np.asarray(angles_deg, dtype=np.float64) - self._zero_deg) * RADIANS_PER_DEGREE

    def directed(self, values: Sequence[int] | FloatArray) -> FloatArray:
        """Convert the sign of motor values to that of the joints."""
        directed: FloatArray = np.asarray(values, dtype=np.float64) * self._sign
        return directed

    def degrees(self, radians: FloatArray, last_deg: Sequence[int] | None = None) -> tuple[int, ...]:
        """Convert joint angles to whole degrees, rounded inwards at the limits.

        Args:
            last_deg: the previous targets; a joint that started beyond a limit stays there until it is
                commanded back, and returns at the commanded speed.
        """
        exact = self._zero_deg + self._sign * radians / RADIANS_PER_DEGREE
        ends = self._zero_deg + self._sign * np.stack((self._low_rad, self._high_rad)) / RADIANS_PER_DEGREE
        low, high = np.ceil(ends.min(axis=0) - 1e-6), np.floor(ends.max(axis=0) + 1e-6)
        if last_deg is not None:
            low, high = np.minimum(low, last_deg), np.maximum(high, last_deg)
        return tuple(int(value) for value in np.clip(np.rint(exact), low, high))
