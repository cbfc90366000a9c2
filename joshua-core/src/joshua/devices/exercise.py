"""An oscillation that exercises joints which nobody commands, for MODE_TEST."""

from __future__ import annotations

import math

import numpy as np

from joshua.devices.actuator import FloatArray, JointLimits
from joshua.devices.joint_command import JointCommand


class Oscillation:
    """A sine about the position where the joints were found, within their limits.

    The amplitude shrinks where the nearer limit is closer, so that the motion starts without a jump.

    Args:
        start_rad: positions at the start, shape (N,).
        limits: of the joints.
        amplitude_rad: half of the way.
        frequency_hz: oscillations per second.
    """

    def __init__(
        self, start_rad: FloatArray, limits: JointLimits, amplitude_rad: float, frequency_hz: float
    ) -> None:
        low, high = limits.position_min_rad, limits.position_max_rad
        self._start = np.clip(start_rad, low, high)
        room = np.minimum(self._start - low, high - self._start)
        self._amplitude = np.minimum(amplitude_rad, room)
        # a joint that was found at a limit has room on one side only
        self._toward_middle = np.where(room < amplitude_rad / 2, np.sign((low + high) / 2 - self._start), 0.0)
        self._span = np.minimum(amplitude_rad, high - low)
        self._angular_rate = math.tau * frequency_hz

    def at(self, time_s: float) -> JointCommand:
        """The command at a time after the start."""
        phase = self._angular_rate * time_s
        two_sided = self._amplitude * math.sin(phase)
        one_sided = self._toward_middle * self._span * (1 - math.cos(phase)) / 2
        position = self._start + np.where(self._toward_middle == 0, two_sided, one_sided)
        return JointCommand(np.arange(len(position)), position)
