"""Virtual motors: first-order motion towards the goal, within the limits, on the machine's own clock."""

from __future__ import annotations

import time

import numpy as np
from joshua.api import Actuator, ActuatorContext, DeviceError, FloatArray, JointReading
from joshua.api.calibration import rad_to_ticks, ticks_to_rad
from joshua.api.motions import FileMotion, Motion, SineMotion

from joshua_mock.settings import MockMotorSettings

NS_PER_S = 1_000_000_000

# No-load speed of a small serial bus servo at 12 V.
VELOCITY_MAX_RAD_S = 4.7


class MockActuator(Actuator):
    """A group of virtual motors with 4096 ticks per turn and zero in the middle.

    With torque a joint follows its goal as a first-order system: its speed is the remaining distance
    divided by the time constant, at most ``VELOCITY_MAX_RAD_S``. Without torque it stays where it is, or
    follows its configured motion, like an arm that a person moves. Readings are whole ticks. Effort is the
    fraction of stall torque that drives the motion: 0 at rest, ±1 at full speed.

    Args:
        settings: the motors.
        context: of its node.
    """

    settings: MockMotorSettings
    velocity_max_rad_s = VELOCITY_MAX_RAD_S

    def __init__(self, settings: MockMotorSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        self._connected = False
        self._energised = False
        self._stamps = self.context.clock
        self._motion: Motion | None = None
        self._start_ns = self._simulated_ns = 0
        self._position = self._goal = np.zeros(len(self.joint_names))

    @property
    def connected(self) -> bool:
        """Whether ``connect`` has been called."""
        return self._connected

    def connect(self) -> None:
        """Place the joints in the middle of their range. Raises DeviceError for a bad motion file."""
        if self._connected:
            raise DeviceError("MockActuator.connect: the device is already open")
        limits = self.limits
        middle = (limits.position_min_rad + limits.position_max_rad) / 2
        self._motion = self._make_motion()
        self._position, self._goal = middle, middle.copy()
        self._start_ns = self._simulated_ns = time.monotonic_ns()
        self._energised = False
        self._connected = True

    def read(self) -> JointReading:
        """Read all joints: whole ticks, in radians; see the class for velocity and effort."""
        self.require_connected("read")
        velocity = self._advance()
        stamp_ns = self._stamps.now_ns()
        position = np.array([ticks_to_rad(rad_to_ticks(value)) for value in self._position])
        effort = velocity / VELOCITY_MAX_RAD_S if self._energised else np.zeros_like(velocity)
        return JointReading(stamp_ns, self.limits.clip(position), velocity, effort)

    def enable(self) -> None:
        """Enable torque on all joints at their present positions."""
        self.require_connected("enable")
        self._advance()
        self._goal = self._position.copy()
        self._energised = True

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Command positions in radians, shape (N,). Returns the goal after the clamp, in whole ticks.

        Raises ValueError for a wrong shape or a value that is not finite, DeviceError without torque.
        """
        self.require_connected("write")
        goal = self.checked_goal(goal_rad)
        if not self._energised:
            raise DeviceError("MockActuator.write: torque is off: call enable first")
        self._advance()
        self._goal = self.limits.clip(goal)
        return self._goal.copy()

    def hold(self) -> None:
        """Stop the joints where they are, without a change of torque."""
        self.require_connected("hold")
        self._advance()
        self._goal = self._position.copy()

    def release(self) -> None:
        """Disable torque; has no effect on a closed device."""
        if self._connected:
            self._advance()
        self._energised = False

    def read_torque(self) -> dict[str, bool]:
        """Return whether torque is enabled, by joint."""
        return dict.fromkeys(self.joint_names, self._energised)

    def disconnect(self) -> None:
        """End the simulation. Idempotent."""
        self._connected = self._energised = False
        self._motion = None

    def _make_motion(self) -> Motion | None:
        settings = self.settings
        if settings.motion == "sine":
            return SineMotion(self.limits, settings.motion_amplitude_rad, settings.motion_frequency_hz)
        if settings.motion == "file":
            return FileMotion(settings.motion_file, self.joint_names)
        return None

    def _advance(self) -> FloatArray:
        """Move the joints to their present positions; return their velocity, shape (N,)."""
        now_ns = time.monotonic_ns()
        elapsed_s = (now_ns - self._simulated_ns) / NS_PER_S
        self._simulated_ns = now_ns
        if self._energised:
            self._position = follow(self._position, self._goal, elapsed_s, self.settings.time_constant_s)
            return _speed(self._goal - self._position, self.settings.time_constant_s)
        if self._motion is None:
            return np.zeros_like(self._position)
        position, velocity = self._motion.at((now_ns - self._start_ns) / NS_PER_S)
        self._position = self.limits.clip(position)
        return np.where(self._position == position, velocity, 0.0)


def _speed(way_rad: FloatArray, time_constant_s: float) -> FloatArray:
    return np.clip(way_rad / time_constant_s, -VELOCITY_MAX_RAD_S, VELOCITY_MAX_RAD_S)


def follow(
    start_rad: FloatArray, goal_rad: FloatArray, elapsed_s: float, time_constant_s: float
) -> FloatArray:
    """Compute the exact solution of the speed-limited first-order motion for any step.

    Far from the goal a joint moves at full speed; from the distance at which the first-order speed is no
    longer above it, the remaining distance decays exponentially.

    Args:
        start_rad: positions at the start, shape (N,).
        goal_rad: goals, shape (N,).
        elapsed_s: time since the start.
        time_constant_s: of the exponential part.

    Returns:
        The positions at the end, shape (N,).
    """
    way = np.abs(goal_rad - start_rad)
    threshold = VELOCITY_MAX_RAD_S * time_constant_s
    full_speed_s = np.clip((way - threshold) / VELOCITY_MAX_RAD_S, 0.0, elapsed_s)
    left = (way - VELOCITY_MAX_RAD_S * full_speed_s) * np.exp(-(elapsed_s - full_speed_s) / time_constant_s)
    return goal_rad - np.sign(goal_rad - start_rad) * left
