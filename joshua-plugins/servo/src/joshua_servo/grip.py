"""Grip mode: a joint that presses on an object holds it with limited torque and gives way before it trips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from joshua.api.calibration import TICKS_PER_TURN

from joshua_servo.bus import ServoBus
from joshua_servo.feedback import Feedback
from joshua_servo.settings import ServoJoint, ServoSettings

PRESSES_S = 0.15  # the start of a move also causes a load
SLOW_TICKS_S = 60.0  # about 5°/s: a faster joint is still moving
NEAR_TRIP = 0.9  # share of the load that trips the servo
REPEAT_S = 0.5  # the torque limit is not acknowledged, so it is written again


@dataclass(frozen=True)
class GripRule:
    """When a joint holds an object, and how.

    Attributes:
        load: fraction of stall torque at which it holds; squeeze_ticks: of the goal beyond the position.
        trip_load, trip_s: load and time of the servo's overload protection.
    """

    load: float
    squeeze_ticks: int
    trip_load: float
    trip_s: float

    @classmethod
    def of(cls, joint: ServoJoint) -> GripRule:
        """The rule of a joint with grip mode."""
        assert joint.grip_load_percent is not None
        assert joint.grip_squeeze_rad is not None
        squeeze = max(1, round(joint.grip_squeeze_rad / math.tau * TICKS_PER_TURN))
        return cls(joint.grip_load_percent / 100, squeeze, joint.overload[0] / 100, joint.overload[1])


class Grip:
    """The grip of one joint.

    Attributes:
        direction: closing direction, 1 or -1, while the joint holds an object; 0 while it is free.
    """

    def __init__(self, rule: GripRule) -> None:
        self._rule = rule
        self._position = 0
        self._pressing_since_s: float | None = None
        self._near_trip_since_s: float | None = None
        self._gives_way = False
        self.direction = 0

    @property
    def squeeze_ticks(self) -> int:
        """Distance of the goal beyond the position while it holds an object."""
        return self._rule.squeeze_ticks

    def look(self, reading: Feedback, wanted: int, now_s: float) -> None:
        """Add a reading. ``wanted`` is the commanded goal in ticks."""
        rule, load = self._rule, abs(reading.load)
        self._position = reading.position
        way = wanted - reading.position
        if not self.direction:
            presses = load >= rule.load and abs(reading.speed) < SLOW_TICKS_S and way != 0
            self._pressing_since_s = (self._pressing_since_s or now_s) if presses else None
            if self._pressing_since_s is not None and now_s - self._pressing_since_s >= PRESSES_S:
                self.direction = 1 if way > 0 else -1
            return
        ahead = way * self.direction
        if ahead <= 0 or (ahead <= rule.squeeze_ticks and load < rule.load):
            self.let_go()
            return
        near_trip = load >= NEAR_TRIP * rule.trip_load
        self._near_trip_since_s = (self._near_trip_since_s or now_s) if near_trip else None
        if self._near_trip_since_s is not None and now_s - self._near_trip_since_s >= rule.trip_s / 2:
            self._gives_way = True
        elif load < rule.load:
            self._gives_way = False

    def let_go(self) -> None:
        """End the grip. The joint follows its commander."""
        self.direction = 0
        self._pressing_since_s = self._near_trip_since_s = None
        self._gives_way = False

    def goal(self, wanted: int) -> int:
        """The goal in ticks to write for a commanded one."""
        if not self.direction:
            return wanted
        squeeze = 0 if self._gives_way else self._rule.squeeze_ticks
        ahead = (wanted - self._position) * self.direction
        return self._position + self.direction * max(0, min(squeeze, ahead))


class Grips:
    """The grips of one arm and the corresponding torque limits of its servos."""

    def __init__(self, settings: ServoSettings, bus: ServoBus) -> None:
        self._bus = bus
        register, steps = settings.tuned["torque_limit_percent"]
        self._register = register
        self._grips: dict[int, Grip] = {}  # by index of the joint
        self._limits: dict[int, tuple[int, int, int]] = {}  # id, limit while free, limit while it holds
        self._written: dict[int, tuple[int, float]] = {}  # direction of the grip, and when
        for index, (servo_id, joint) in enumerate(
            zip(settings.motor_ids, settings.joint_settings, strict=True)
        ):
            if joint.grip_load_percent:
                assert joint.grip_torque_percent is not None
                self._grips[index] = Grip(GripRule.of(joint))
                free = round((joint.torque_limit_percent or 100) * steps)
                self._limits[index] = (servo_id, free, round(joint.grip_torque_percent * steps))

    @property
    def stops(self) -> dict[int, tuple[int, int]]:
        """Parameters for holding objects without this driver, by servo id: squeeze in ticks, torque limit."""
        return {
            self._limits[index][0]: (grip.squeeze_ticks, self._limits[index][2])
            for index, grip in self._grips.items()
        }

    @property
    def limit_register(self) -> tuple[int, int]:
        """Address and width of the register of the torque limit."""
        return self._register.address, self._register.width

    def reset(self) -> None:
        """End all grips and restore the torque limits of the settings."""
        for grip in self._grips.values():
            grip.let_go()
        self._written = {}

    def look(self, readings: Sequence[Feedback], wanted: Sequence[int], now_s: float) -> None:
        """Add the readings of all joints and the commanded goals in ticks."""
        for index, grip in self._grips.items():
            grip.look(readings[index], int(wanted[index]), now_s)

    def goals(self, wanted: Sequence[int]) -> list[int]:
        """The goals in ticks to write for the commanded ones."""
        goals = list(map(int, wanted))
        for index, grip in self._grips.items():
            goals[index] = grip.goal(goals[index])
        return goals

    def held(self, present: Sequence[int], wanted: Sequence[int]) -> list[int]:
        """The goals in ticks that hold the joints and their objects in place."""
        return [
            self._grips[index].goal(int(wanted[index]))
            if index in self._grips and self._grips[index].direction
            else int(ticks)
            for index, ticks in enumerate(present)
        ]

    def write_limits(self, now_s: float) -> None:
        """Write torque limits when a grip begins or ends, and periodically. Raises PortDisconnected."""
        rows = {}
        for index, grip in self._grips.items():
            direction, at_s = self._written.get(index, (0, now_s))
            if grip.direction != direction or (index in self._written and now_s - at_s >= REPEAT_S):
                servo_id, free, holding = self._limits[index]
                rows[servo_id] = self._register.encode(holding if grip.direction else free)
                self._written[index] = (grip.direction, now_s)
        if rows:
            self._bus.sync_write(self._register.address, self._register.width, rows)
