"""The driver of the gripper; in place of a bus it moves a simulated finger at constant speed."""

import time

import numpy as np
from joshua.api import Actuator, DeviceError, FloatArray, JointReading

from acme_gripper.settings import GripperSettings


class Gripper(Actuator):
    """One joint, ``gripper``: 0 when closed, its largest angle when open."""

    settings: GripperSettings
    connected = False
    _energised = False
    _position = _goal = _moved_s = 0.0

    @property
    def velocity_max_rad_s(self) -> float:
        """Speed of the finger."""
        return self.settings.speed_rad_s

    def connect(self) -> None:
        """Open the gripper's link."""
        self.connected, self._moved_s = True, time.monotonic()

    def read(self) -> JointReading:
        """Read position, speed and effort."""
        self.require_connected("read")
        direction, speed = np.sign([self._move()]), self.settings.speed_rad_s
        return JointReading(
            self.context.clock.now_ns(), np.array([self._position]), direction * speed, direction
        )

    def enable(self) -> None:
        """Enable torque with the goal at the present position."""
        self.hold()
        self._energised = True

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Command a position; return it after clamping."""
        goal = self.limits.clip(self.checked_goal(goal_rad))
        if not self._energised:
            raise DeviceError("the gripper has no torque: call enable first")
        self._move()
        self._goal = float(goal[0])
        return goal

    def hold(self) -> None:
        """Stop at the present position."""
        self.require_connected("hold")
        self._move()
        self._goal = self._position

    def release(self) -> None:
        """Disable torque."""
        self._energised, self._goal = False, self._position

    def disconnect(self) -> None:
        """Close the link."""
        self.connected = self._energised = False

    def _move(self) -> float:
        """Advance the finger to the present time. Return the remaining motion."""
        elapsed_s, self._moved_s = time.monotonic() - self._moved_s, time.monotonic()
        step = self.settings.speed_rad_s * elapsed_s
        self._position += float(np.clip(self._goal - self._position, -step, step))
        return self._goal - self._position
