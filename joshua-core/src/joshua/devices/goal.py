"""Turns commands into goals: seeded, ramped, clamped, limited in speed, and held when commands stop."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from enum import Enum

import numpy as np

from joshua.devices.actuator import FloatArray, JointLimits
from joshua.devices.joint_command import JointCommand, TrajectoryCommand
from joshua.node.verbs import RefusedError, verb
from joshua.plan import OnStale

NS_PER_S = 1_000_000_000

#: Speed at which joints approach a first command: slow enough for a person to step back.
RAMP_SPEED_RAD_S = 1.0

#: Time without a command after which the joints hold.
STALE_AFTER_S = 0.5


class GoalState(str, Enum):
    """The source of the goals."""

    WAITING = "waiting"
    """No command yet: the joints stay where they were."""
    FOLLOWING = "following"
    """Commands arrive."""
    HOLDING = "holding"
    """Commands stopped: the joints stay at the last goal."""
    PARKING = "parking"
    """Commands have stopped for too long: the joints move to their park pose, unless commands return."""


@dataclass(frozen=True)
class SpeedScale:
    """A share of the speed limits, above 0 and at most 1."""

    scale: float


class GoalGenerator:
    """Makes the goal of each control cycle.

    Commands come from a transport thread, steps from the control loop. Each joint approaches its first
    command, and the first after a pause, at ``ramp_speed_rad_s`` at most; once it has caught up, the speed
    limit of the device applies. Joints that no command names stay where they are.

    Args:
        limits: of the joints.
        period_s: nominal length of a control cycle; a longer pause does not allow a longer step than two.
        stale_after_s: time without a command after which the joints hold. A trajectory that plays or has
            ended is not stale, because it defines where the joints stay.
        ramp_speed_rad_s: largest speed of the approach.

    Attributes:
        stale: commands arrived and stopped, without an order to hold.
        speed_scale_parameter: share of their speed limits that the joints may use.
    """

    def __init__(
        self,
        limits: JointLimits,
        period_s: float,
        *,
        stale_after_s: float = STALE_AFTER_S,
        ramp_speed_rad_s: float = RAMP_SPEED_RAD_S,
    ) -> None:
        self.limits = limits
        self._period_s = period_s
        self._stale_after_ns = round(stale_after_s * NS_PER_S)
        low, high, speed = limits.position_min_rad, limits.position_max_rad, limits.velocity_max_rad_s
        columns = (low, high, speed, np.minimum(ramp_speed_rad_s, speed))
        self._bounds = list(zip(*(column.tolist() for column in columns), strict=True))
        count = len(limits.position_min_rad)
        self._lock = threading.Lock()
        self._goal = np.zeros(count)
        self._target = np.full(count, np.nan)
        self._ramping = np.ones(count, bool)
        self._trajectory: TrajectoryCommand | None = None
        self._trajectory_start: tuple[int, FloatArray] | None = None
        self._command_ns: int | None = None
        self._step_ns: int | None = None
        self.state = GoalState.WAITING
        self.stale = False
        self.speed_scale_parameter = 1.0

    @property
    def ramping(self) -> bool:
        """Whether a commanded joint is still on its approach."""
        return bool((self._ramping & np.isfinite(self._target)).any())

    @verb(moves=False, sets="speed_scale")
    def limit_speed(self, request: SpeedScale) -> str:
        """Limit the joints to a share of their speed limits, above 0 and at most 1."""
        if not 0.0 < request.scale <= 1.0:
            raise RefusedError(f"scale is {request.scale:g}; it must be above 0 and at most 1")
        self.speed_scale_parameter = request.scale
        return f"the joints use {request.scale:.0%} of their speed limits"

    def seed(self, position_rad: FloatArray) -> None:
        """Starts at the joints' positions, shape (N,). Discards every command."""
        with self._lock:
            self._goal = np.array(position_rad, np.float64)
            self._forget()
            self._step_ns = None
            self.state = GoalState.WAITING
            self.stale = False

    def reseed(self, index: int, position_rad: float) -> None:
        """Restarts one joint at its position. It approaches its command slowly. Thread-safe."""
        with self._lock:
            self._goal[index] = position_rad
            self._ramping[index] = True

    def command(self, command: JointCommand, now_ns: int) -> None:
        """Takes a command; ``now_ns`` on the monotonic clock. Thread-safe."""
        with self._lock:
            self._trajectory = self._trajectory_start = None
            if self.state is GoalState.PARKING:
                self._forget()
            self._target[command.indices] = command.position_rad
            self._command_ns = now_ns
            self.state = GoalState.FOLLOWING
            self.stale = False

    def play(self, trajectory: TrajectoryCommand, now_ns: int) -> None:
        """Starts a trajectory in place of the present command. One without points stops the joints."""
        with self._lock:
            self._command_ns = None
            self._target[:] = np.nan
            self._trajectory = trajectory if len(trajectory.time_s) else None
            self._trajectory_start = (now_ns, self._goal[trajectory.indices].copy())
            self.state = GoalState.FOLLOWING if self._trajectory else GoalState.HOLDING
            self.stale = False

    def park(self, pose_rad: FloatArray) -> None:
        """Moves holding joints to a pose, shape (N,), as slowly as to a first command. Thread-safe."""
        with self._lock:
            if self.state is GoalState.HOLDING:  # no command arrived in the meantime
                self._target = np.array(pose_rad, np.float64)
                self._ramping[:] = True
                self.state = GoalState.PARKING

    def approach(self) -> None:
        """Makes the joints approach the next command slowly, as a first one. Thread-safe."""
        with self._lock:
            self._ramping[:] = True

    def hold(self) -> None:
        """Drops every command: the joints hold until the next one, and approach it slowly. Thread-safe."""
        with self._lock:
            self._forget()
            self.state = GoalState.HOLDING
            self.stale = True

    def step(self, now_ns: int) -> FloatArray:
        """The goal of this control cycle, shape (N,); ``now_ns`` on the monotonic clock."""
        with self._lock:
            elapsed_s = self._elapsed_s(now_ns)
            if self._command_ns is not None and now_ns - self._command_ns > self._stale_after_ns:
                self._forget()
                self.state = GoalState.HOLDING
                self.stale = True
            if self._trajectory is not None and self._trajectory_start is not None:
                start_ns, start_rad = self._trajectory_start
                played_s = (now_ns - start_ns) / NS_PER_S
                self._target[self._trajectory.indices] = self._trajectory.at(played_s, start_rad)
            self._move(elapsed_s)
            return self._goal.copy()

    def _elapsed_s(self, now_ns: int) -> float:
        elapsed_s = self._period_s if self._step_ns is None else (now_ns - self._step_ns) / NS_PER_S
        self._step_ns = now_ns
        return min(max(elapsed_s, 0.0), 2 * self._period_s)

    def _move(self, elapsed_s: float) -> None:
        """In plain Python: faster for a few joints than arrays are."""
        elapsed_s *= self.speed_scale_parameter
        goal, ramping = self._goal.tolist(), self._ramping.tolist()
        for index, target in enumerate(self._target.tolist()):
            if not math.isfinite(target):
                continue
            low, high, speed, ramp_speed = self._bounds[index]
            way = min(max(target, low), high) - goal[index]
            ramping[index] = ramping[index] and abs(way) > ramp_speed * elapsed_s
            largest = (ramp_speed if ramping[index] else speed) * elapsed_s
            goal[index] += min(max(way, -largest), largest)
        self._goal, self._ramping[:] = np.array(goal), ramping

    def _forget(self) -> None:
        self._target[:] = np.nan
        self._ramping[:] = True
        self._trajectory = self._trajectory_start = None
        self._command_ns = None


PARK = "PARK_THEN_RELEASE"

#: A joint this close to its park pose has arrived: about the sag of a desk arm's servo under gravity.
ARRIVED_RAD = 0.05


class StalePolicy:
    """The policy of an actuator whose joints do not hold indefinitely.

    Args:
        goals: of the actuator, used to park it.
        policy: action of the joints, and its time.
    """

    def __init__(self, goals: GoalGenerator, policy: OnStale) -> None:
        self._goals = goals
        self._action, self._after_s, self._timeout_s = policy.action, policy.after_s, policy.timeout_s
        self._pose = np.array(policy.pose_rad, np.float64)
        self._state = GoalState.WAITING
        self._since_s = 0.0

    def look(self, position_rad: FloatArray, now_s: float) -> str:
        """Adds the state of a control cycle. Returns why the torque must be switched off now, or ""."""
        state = self._goals.state if self._goals.stale else GoalState.FOLLOWING
        if state is not self._state:
            self._state, self._since_s = state, now_s
        elapsed_s = now_s - self._since_s
        if state is GoalState.HOLDING and elapsed_s >= self._after_s:
            if self._action != PARK:
                return f"commands did not resume within {self._after_s:g} s: torque was switched off"
            self._goals.park(self._pose)
        if state is GoalState.PARKING:
            if np.abs(position_rad - self._goals.limits.clip(self._pose)).max() < ARRIVED_RAD:
                return "commands did not resume: the joints were parked and torque was switched off"
            if elapsed_s >= self._timeout_s:
                return (
                    "commands did not resume: torque was switched off; the park pose was not reached within "
                    f"{self._timeout_s:g} s"
                )
        return ""
