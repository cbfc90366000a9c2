"""The mechanics and heat of one geared joint: position, speed, load and temperature over time.

Positions are in encoder ticks (4096 a turn) of an unwrapped shaft angle. The joint moves by a trapezoidal
speed profile as servo firmware does; it is a model of what a driver can observe, not of the motor.

Current and heat follow the published figures of the STS3215 at 12 V. It stalls at 30 kg·cm and 2.7 A
(datasheet). Under a static load of 15 kg·cm its temperature settled at 48 °C within ten minutes
(robonine.com, 2025). The copper loss goes with the square of the load, so a stalled motor settles
100 K above the air around it and passes the limit of 70 °C after two minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

TICKS_PER_TURN = 4096
STEP_S = 0.004  # longest integration step
FRICTION = 0.08  # fraction of stall torque that the gear holds with torque off
STALL_CURRENT_A = 2.7
TEMPERATURE_TIME_CONSTANT_S = 200.0
STALL_TEMPERATURE_RISE_K = 100.0


@dataclass(frozen=True)
class Drive:
    """Command of the servo's controller to the motor.

    Attributes:
        mode: ``off``, ``position`` or ``speed``.
        target: shaft angle in ticks, or speed in ticks/s in mode ``speed``.
        speed_limit: ticks/s; acceleration: ticks/s²; torque_limit: fraction of stall torque.
        stiffness: load fraction per tick of error.
    """

    mode: str = "off"
    target: float = 0.0
    speed_limit: float = 3400.0
    acceleration: float = 25_400.0
    torque_limit: float = 1.0
    stiffness: float = 0.032


class Joint:
    """One joint. ``hand`` moves it while the drive is off: a function of time to shaft angle in ticks."""

    def __init__(self, angle: float, low: float = -math.inf, high: float = math.inf) -> None:
        self.angle = angle
        self.low = low  # mechanical stops
        self.high = high
        self.velocity = 0.0
        self.load = 0.0  # fraction of stall torque, signed
        self.ambient_c = 25.0
        self.temperature_c = 27.0
        self.external_load = 0.0  # fraction of stall torque that pushes the joint towards higher ticks
        self.blocked = False  # the joint is blocked
        self._object: tuple[float, int] | None = None  # where the object begins, and in which direction
        self.hand: Callable[[float], float] | None = None
        self._time_s: float | None = None

    @property
    def current_a(self) -> float:
        """Motor current, at least zero."""
        return abs(self.load) * STALL_CURRENT_A

    def put_object(self, angle: float | None) -> None:
        """Place a stiff object in the joint's way at a shaft angle in ticks; None removes it."""
        self._object = None if angle is None else (angle, 1 if angle >= self.angle else -1)

    def advance(self, now_s: float, drive: Drive) -> None:
        """Advance the joint to a monotonic time; an earlier time has no effect."""
        if self._time_s is None:
            self._time_s = now_s - STEP_S
        elapsed_s = now_s - self._time_s
        if elapsed_s <= 0:
            return
        self._time_s = now_s
        self._heat(elapsed_s)
        if drive.mode == "off" and self.hand is not None:
            self._follow_hand(now_s, elapsed_s)
            return
        steps = max(1, math.ceil(elapsed_s / STEP_S))
        step_s = elapsed_s / steps
        for _ in range(steps):
            if not self._step(step_s, drive):
                break

    def _heat(self, elapsed_s: float) -> None:
        settled_c = self.ambient_c + STALL_TEMPERATURE_RISE_K * self.load * self.load
        share = 1.0 - math.exp(-elapsed_s / TEMPERATURE_TIME_CONSTANT_S)
        self.temperature_c += (settled_c - self.temperature_c) * share

    def _follow_hand(self, now_s: float, elapsed_s: float) -> None:
        assert self.hand is not None
        wanted = min(max(self.hand(now_s), self.low), self.high)
        self.velocity = (wanted - self.angle) / elapsed_s
        self.angle = wanted
        self.load = 0.0

    def _step(self, step_s: float, drive: Drive) -> bool:
        """Advance by one step; return False in a steady state."""
        capacity = FRICTION + (drive.torque_limit if drive.mode != "off" else 0.0)
        if abs(self.external_load) > capacity and not self.blocked:
            return self._give_way(step_s, drive, capacity)
        if drive.mode == "off":
            self.velocity = self.load = 0.0
            return False
        if drive.mode == "speed":
            wanted = max(-drive.speed_limit, min(drive.speed_limit, drive.target))
            error = wanted
        else:
            error = drive.target - self.angle
            wanted = self._profile_speed(error, drive)
        if self.blocked or self._at_stop(wanted):
            self.velocity = 0.0
            self.load = _clip(error * drive.stiffness, drive.torque_limit)
            return False
        return self._move(step_s, drive, error, wanted)

    def _profile_speed(self, error: float, drive: Drive) -> float:
        if abs(error) < 0.5:
            return 0.0
        braking = math.sqrt(2.0 * drive.acceleration * abs(error))
        return math.copysign(min(drive.speed_limit, braking), error)

    def _move(self, step_s: float, drive: Drive, error: float, wanted: float) -> bool:
        change = _clip(wanted - self.velocity, drive.acceleration * step_s)
        velocity = self.velocity + change
        travel = velocity * step_s
        if (
            drive.mode == "position"
            and abs(travel) >= abs(error)
            and abs(error) < 200
            and travel * error >= 0
        ):
            self.angle = drive.target
            self.velocity = 0.0
            self.load = _clip(-self.external_load, drive.torque_limit)
            return False
        self.angle = self._within(self.angle + travel)
        self.velocity = velocity
        effort = change / (drive.acceleration * step_s) * 0.3 + velocity / 3400.0 * 0.2 - self.external_load
        self.load = _clip(effort, drive.torque_limit)
        return velocity != 0.0 or wanted != 0.0

    def _give_way(self, step_s: float, drive: Drive, capacity: float) -> bool:
        excess = abs(self.external_load) - capacity
        self.velocity = math.copysign(excess * 3400.0, self.external_load)
        if self._at_stop(self.velocity):
            self.velocity = 0.0
        self.angle = self._within(self.angle + self.velocity * step_s)
        self.load = math.copysign(drive.torque_limit, -self.external_load) if drive.mode != "off" else 0.0
        return True

    def _ends(self) -> tuple[float, float]:
        """Return the range of motion, including an object in the way."""
        at, direction = self._object or (0.0, 0)
        return at if direction < 0 else self.low, at if direction > 0 else self.high

    def _within(self, angle: float) -> float:
        low, high = self._ends()
        return min(max(angle, low), high)

    def _at_stop(self, direction: float) -> bool:
        low, high = self._ends()
        return (direction > 0 and self.angle >= high) or (direction < 0 and self.angle <= low)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
