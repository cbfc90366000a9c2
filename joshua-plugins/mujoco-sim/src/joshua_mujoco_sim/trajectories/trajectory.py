"""A recorded motion as arrays, and the mapping of its columns to the joints of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from joshua.api import ConfigurationError
from joshua.features import CalibratedJoint, JointUnits, Unit
from joshua.features.feature_set import LEROBOT_SUFFIX
from joshua.features.joint_units import is_gripper

FloatArray = npt.NDArray[np.float64]


#: Largest number of values in memory: eight hours of six joints at 100 Hz, 160 MB.
MOST_NUMBERS = 20_000_000

#: LeRobot's normalised values end at 100; larger values, apart from rounding, are degrees.
LARGEST_NORMALISED = 101.0

#: Largest number of characters per sample in a text file.
LONGEST_LINE = 1 << 20


class TrajectoryError(ConfigurationError):
    """A recording cannot be read or does not fit the model. The message gives place, reason and remedy."""


class MissingExtraError(TrajectoryError):
    """A recording cannot be read because a library is not installed. The message names it."""

    exit_code: ClassVar[int] = 3


class Budget:
    """Remaining budget of values in one replay."""

    def __init__(self) -> None:
        self._most = self._left = MOST_NUMBERS

    def take(self, source: str | Path, count: int) -> None:
        """Count values against the budget. Raises TrajectoryError."""
        self._left -= count
        if self._left < 0:
            raise TrajectoryError(
                f"{source} is too long to be replayed at once: more than {self._most} numbers (samples times "
                "columns): cut it into parts, keep fewer samples a second, or name fewer episodes"
            )


@dataclass(frozen=True)
class Trajectory:
    """Positions over time.

    Attributes:
        source: file name for messages.
        names: joints in column order; () if the recording names none.
        time_s: shape (T,), increasing, from 0.
        position: in ``unit``, shape (T, N).
        unit: a value of ``joshua.features.Unit``; "" means LeRobot's unit for names that end in ``.pos`` and
            radians for others.
    """

    source: str
    names: tuple[str, ...]
    time_s: FloatArray
    position: FloatArray
    unit: str = ""

    def __post_init__(self) -> None:
        if not len(self.time_s):
            raise TrajectoryError(f"{self.source} has no samples: record some first")
        bad = np.flatnonzero(~np.isfinite(self.position).all(axis=1) | ~np.isfinite(self.time_s))
        if len(bad):
            raise TrajectoryError(
                f"{self.source}: sample {int(bad[0]) + 1} holds a value that is not a finite number"
            )
        back = np.flatnonzero(np.diff(self.time_s) <= 0)
        if len(back):
            raise TrajectoryError(
                f"{self.source}: the time of sample {int(back[0]) + 2} is not later than the one before it"
            )

    @property
    def duration_s(self) -> float:
        """Time of the last sample."""
        return float(self.time_s[-1])

    def for_joints(self, ranges: Mapping[str, tuple[float, float]]) -> tuple[tuple[str, ...], FloatArray]:
        """Select the columns of a model's joints.

        Args:
            ranges: limits in radians of the model's driven joints, in order.

        Returns:
            The joints that the recording moves, and their positions in radians, shape (T, M).

        Raises:
            TrajectoryError: no column fits a joint.
        """
        joints = list(ranges)
        plain = [name.removesuffix(LEROBOT_SUFFIX) for name in self.names]
        if plain and not set(plain) & set(joints):
            if len(plain) != len(joints) or any(get_close_matches(name, joints, n=1) for name in plain):
                raise TrajectoryError(
                    f"{self.source}: no column fits a joint of the model: it has {', '.join(self.names)}, "
                    f"and the model has {', '.join(joints)}: rename the columns"
                )
            plain = list(joints)  # joint_1 … in joint order
        if not plain:
            if self.position.shape[1] != len(joints):
                raise TrajectoryError(
                    f"{self.source} has {self.position.shape[1]} columns without names, and the model has "
                    f"{len(joints)} driven joints ({', '.join(joints)}): name the columns after the joints"
                )
            plain = list(joints)
        columns = [index for index, name in enumerate(plain) if name in joints]
        moved = tuple(plain[index] for index in columns)
        lerobot = [bool(self.names) and self.names[index].endswith(LEROBOT_SUFFIX) for index in columns]
        return moved, self._radians(self.position[:, columns], moved, lerobot, ranges)

    def _radians(
        self,
        values: FloatArray,
        joints: tuple[str, ...],
        lerobot: Sequence[bool],
        ranges: Mapping[str, tuple[float, float]],
    ) -> FloatArray:
        """Return the columns of some joints in radians; ``lerobot`` marks LeRobot names."""
        beyond = any(
            is_lerobot and not is_gripper(joint) and np.abs(column).max() > LARGEST_NORMALISED
            for joint, column, is_lerobot in zip(joints, values.T, lerobot, strict=True)
        )
        by_name = Unit.LEROBOT_DEGREES if beyond else Unit.LEROBOT
        position = values.copy()
        for column, (joint, is_lerobot) in enumerate(zip(joints, lerobot, strict=True)):
            unit = Unit(self.unit) if self.unit else by_name if is_lerobot else Unit.RADIANS
            if unit is Unit.RADIANS:
                continue
            # data sets with other layouts also have grippers from -100 to 100
            percent = is_gripper(joint) and values[:, column].min() >= 0
            try:
                units = JointUnits([CalibratedJoint(joint, *ranges[joint], percent=percent)])
            except ValueError as error:
                raise TrajectoryError(f"{self.source}: {error}") from error
            position[:, column : column + 1] = units.to_radians(values[:, column : column + 1], unit)
        return position
