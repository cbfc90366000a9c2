"""Motions of the user's hand on the joints of an arm with torque off."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from joshua_calibration.hand import hand_paths, interpolate

from joshua_emulator.arms import TICKS_PER_RADIAN

MIDDLE = 2048
PHASE_STEP_RAD = 0.7  # between neighbouring joints, so that they can be told apart

Trajectory = Callable[[float], float]  # seconds since the start to radians about the calibrated zero


class MotionError(ValueError):
    """An invalid motion. The message says why and what is allowed."""


def sine(values: Mapping[str, Any], joints: Sequence[str]) -> dict[int, Trajectory]:
    """Each joint follows a sine about ``center_rad``, neighbours a phase apart; it starts at the centre.

    Args:
        values: ``amplitude_rad`` (0.5), ``frequency_hz`` (0.2), ``center_rad`` (0).
        joints: names of the joints, in order.
    """
    numbers = _numbers(values, {"amplitude_rad": 0.5, "frequency_hz": 0.2, "center_rad": 0.0})
    amplitude, frequency, center = (numbers[k] for k in ("amplitude_rad", "frequency_hz", "center_rad"))

    def make(phase: float) -> Trajectory:
        def position(time_s: float) -> float:
            fade_in = min(1.0, time_s)
            return center + fade_in * amplitude * math.sin(math.tau * frequency * time_s + phase)

        return position

    return {index: make(index * PHASE_STEP_RAD) for index in range(len(joints))}


def sweep(values: Mapping[str, Any], ranges: Sequence[tuple[float, float]]) -> dict[int, Trajectory]:
    """One joint after the other goes from its middle to its low stop, to its high stop and back.

    Args:
        values: ``seconds_per_joint`` (4).
        ranges: mechanical range of each joint in radians about the calibrated zero.
    """
    seconds = _numbers(values, {"seconds_per_joint": 4.0})["seconds_per_joint"]
    if seconds <= 0:
        raise MotionError(f"seconds_per_joint is {seconds}; it must be above 0")

    def make(index: int, low: float, high: float) -> Trajectory:
        middle = (low + high) / 2
        corners = [(0.0, middle), (0.25, low), (0.75, high), (1.0, middle)]
        points = [((index + share) * seconds, value) for share, value in corners]
        return lambda time_s: interpolate(points, time_s)

    return {index: make(index, low, high) for index, (low, high) in enumerate(ranges)}


def calibrating(
    joint: int | None, present: Sequence[float], ranges: Sequence[tuple[float, float]], seconds: float
) -> dict[int, Trajectory]:
    """What a calibration asks of a person, once: all joints to their middles, or one through its range.

    Args:
        joint: the one that goes to its low stop, to its high stop and to its middle while the others stay
            where they are; None for the middles.
        present: where the joints are now; ranges: their mechanical ranges, in radians about the same zero.
        seconds: that it takes.
    """
    try:
        return hand_paths(joint, present, ranges, seconds)
    except ValueError as error:
        raise MotionError(str(error)) from error


def recorded(values: Mapping[str, Any], joints: Sequence[str]) -> dict[int, Trajectory]:
    """Replay a CSV file: a header ``time_s,NAME,…``, then seconds and radians in each line.

    Args:
        values: ``file``.
        joints: names of the joints; columns may also be called ``joint_1`` and so on by place.
    """
    if set(values) != {"file"}:
        raise MotionError(f"a recorded motion takes file alone; found: {', '.join(values) or 'nothing'}")
    path = Path(str(values["file"]))
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        table = [[float(cell) for cell in row] for row in rows if row]
    except OSError as error:
        raise MotionError(f"{path}: cannot be read ({error.strerror}); name an existing CSV file") from error
    except ValueError as error:
        raise MotionError(f"{path}: is not a table of numbers with a header line ({error})") from error
    if not header or header[0] != "time_s" or not table:
        raise MotionError(f"{path}: the header must begin with time_s and a line of numbers must follow")
    if any(len(row) != len(header) for row in table):
        raise MotionError(f"{path}: every line needs {len(header)} numbers, as the header has")
    if any(later[0] <= earlier[0] for earlier, later in pairwise(table)):
        raise MotionError(f"{path}: time_s must rise from line to line")
    return {
        _index(name, joints, path): _column(table, column) for column, name in enumerate(header) if column
    }


def ticks(position_rad: float) -> float:
    """Return the ticks of a calibrated joint at an angle."""
    return MIDDLE + position_rad * TICKS_PER_RADIAN


def _column(table: list[list[float]], column: int) -> Trajectory:
    points = [(row[0], row[column]) for row in table]
    return lambda time_s: interpolate(points, time_s)


def _index(name: str, joints: Sequence[str], path: Path) -> int:
    if name in joints:
        return joints.index(name)
    numbered = [f"joint_{index + 1}" for index in range(len(joints))]
    if name in numbered:
        return numbered.index(name)
    raise MotionError(f"{path}: no joint is called {name!r}; allowed: {', '.join([*joints, *numbered])}")


def _numbers(values: Mapping[str, Any], defaults: Mapping[str, float]) -> dict[str, float]:
    numbers = dict(defaults)
    for key, value in values.items():
        if key not in defaults:
            raise MotionError(f"unknown setting {key!r}; allowed: {', '.join(defaults)}")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise MotionError(f"{key} is {value!r}; allowed: a finite number")
        numbers[key] = float(value)
    return numbers
