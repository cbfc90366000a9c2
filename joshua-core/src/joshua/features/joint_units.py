"""Positions of joints in radians, degrees, and the units of LeRobot's data sets and policies.

The conversions follow from a calibration: the range in ticks and the direction. A position of t ticks is
``sign · (t - zero) · 2π / ticks_per_turn`` radians, where sign is -1 for an inverted motor. In LeRobot's
units, the same position is

- ``200 · (t - range_min) / (range_max - range_min) - 100``, negated with drive mode 1 (``RANGE_M100_100``),
- ``100 · (t - range_min) / (range_max - range_min)``, or 100 minus that with drive mode 1 (``RANGE_0_100``),
- ``360 · (t - (range_min + range_max) / 2) / (ticks_per_turn - 1)``, whatever the drive mode (``DEGREES``).

Each unit is linear in the position in radians, so conversions in both directions are exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.features.feature_set import LEROBOT_SUFFIX
from joshua.plan.feature import Feature
from joshua.plan.joints import JointRange

FloatArray = npt.NDArray[np.float64]

TICKS_PER_TURN = 4096


class Unit(str, Enum):
    """A unit of joint positions. The values are those of ``Feature.unit``."""

    RADIANS = "rad"
    DEGREES = "deg"
    """Relative to the zero of the calibration, like radians."""
    LEROBOT = "lerobot"
    """LeRobot's normalised values: -100 to 100 over the calibrated range, grippers 0 to 100."""
    LEROBOT_DEGREES = "lerobot_deg"
    """LeRobot's ``use_degrees``: from the middle of the range, in the motor's direction; grippers 0 to 100.
    """


@dataclass(frozen=True)
class CalibratedJoint:
    """The calibrated range of one joint.

    Attributes:
        name: of the joint; min_rad, max_rad: ends of the range, the first below the second.
        inverted: the motor counts against the joint's positive direction.
        ticks_per_turn: of the motor's encoder.
        percent: LeRobot normalises it to 0…100 instead of -100…100, as for grippers.
    """

    name: str
    min_rad: float
    max_rad: float
    inverted: bool = False
    ticks_per_turn: int = TICKS_PER_TURN
    percent: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.max_rad - self.min_rad < math.inf:
            raise ValueError(
                f"{self.name}: {self.min_rad} to {self.max_rad} rad is no valid range: calibrate the joint, "
                "or give it limits"
            )


class JointUnits:
    """Conversions for the joints of one arm. Arrays have shape (…, N) in joint order.

    Args:
        joints: with their calibrated ranges.

    Raises:
        ValueError: two joints have the same name.
    """

    def __init__(self, joints: Iterable[CalibratedJoint]) -> None:
        self.joints = tuple(joints)
        self.names = tuple(joint.name for joint in self.joints)
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"two joints have one name: {', '.join(self.names)}")
        # value = value at the anchor + (position - anchor) · gain; the conversion is exact at the anchor
        self._lines = {
            unit: np.array([_line(j, unit) for j in self.joints]).reshape(-1, 3).T for unit in Unit
        }

    @classmethod
    def from_calibration(
        cls,
        motors: Iterable[Any],
        *,
        ticks_per_turn: int = TICKS_PER_TURN,
        zero_ticks: float | None = None,
    ) -> JointUnits:
        """Units of a calibrated arm.

        Args:
            motors: in joint order, each with ``joint_name``, ``range_min``, ``range_max`` (ticks, homing
                offset applied) and ``inverted``: ``MotorCalibration`` or the message of that name.
            ticks_per_turn: of the encoders; zero_ticks: zero radians, None for the middle of a turn.
        """
        zero = ticks_per_turn / 2 if zero_ticks is None else zero_ticks
        ranges = []
        for motor in motors:
            low, high = ((t - zero) * math.tau / ticks_per_turn for t in (motor.range_min, motor.range_max))
            low, high = (-high, -low) if motor.inverted else (low, high)
            name = motor.joint_name
            ranges.append(CalibratedJoint(name, low, high, motor.inverted, ticks_per_turn, is_gripper(name)))
        return cls(ranges)

    @classmethod
    def from_ranges(cls, joints: Iterable[JointRange]) -> JointUnits:
        """Units of joints with limits but without motors, such as those of a simulated arm."""
        return cls(
            CalibratedJoint(joint.name, joint.min_rad, joint.max_rad, percent=is_gripper(joint.name))
            for joint in joints
        )

    def chosen(self, names: Sequence[str]) -> JointUnits:
        """Return the units of selected joints, in the given order. Raises KeyError for an unknown name."""
        by_name = {joint.name: joint for joint in self.joints}
        return JointUnits(by_name[name] for name in names)

    def from_radians(self, position_rad: npt.ArrayLike, unit: Unit, *, clip: bool = False) -> FloatArray:
        """Converts positions.

        Args:
            position_rad: shape (…, N); unit: to convert to.
            clip: clip normalised values to their range, as LeRobot does.
        """
        anchor, at_anchor, gain = self._lines[unit]
        values: FloatArray = at_anchor + (np.asarray(position_rad, np.float64) - anchor) * gain
        if clip:
            bounded = [_is_normalised(joint, unit) for joint in self.joints]
            values = np.where(bounded, np.clip(values, at_anchor, 100.0), values)
        return values

    def to_radians(self, values: npt.ArrayLike, unit: Unit) -> FloatArray:
        """Converts values of a unit, shape (…, N), to positions in radians."""
        anchor, at_anchor, gain = self._lines[unit]
        position: FloatArray = anchor + (np.asarray(values, np.float64) - at_anchor) / gain
        return position

    def feature(self, feature: Feature, unit: Unit) -> Feature:
        """Convert a feature in radians to another unit, with LeRobot's names that end in ``.pos``."""
        ending = LEROBOT_SUFFIX if unit in (Unit.LEROBOT, Unit.LEROBOT_DEGREES) else ""
        return replace(feature, unit=unit.value, names=tuple(name + ending for name in feature.names))


def is_gripper(name: str) -> bool:
    """Whether LeRobot normalises a joint to 0…100, by its name."""
    return name == "gripper" or name.endswith("_gripper")


def _is_normalised(joint: CalibratedJoint, unit: Unit) -> bool:
    return unit is Unit.LEROBOT or (joint.percent and unit is Unit.LEROBOT_DEGREES)


def _line(joint: CalibratedJoint, unit: Unit) -> tuple[float, float, float]:
    """Position in radians, value there, and values per radian."""
    if unit is Unit.RADIANS:
        return 0.0, 0.0, 1.0
    if unit is Unit.DEGREES:
        return 0.0, 0.0, 180 / math.pi
    if _is_normalised(joint, unit):
        least = 0.0 if joint.percent else -100.0
        return joint.min_rad, least, (100.0 - least) / (joint.max_rad - joint.min_rad)
    sign = -1.0 if joint.inverted else 1.0
    turn = 360.0 * joint.ticks_per_turn / (joint.ticks_per_turn - 1)
    return (joint.min_rad + joint.max_rad) / 2, 0.0, sign * turn / math.tau
