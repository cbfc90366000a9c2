"""Motions of virtual arms, as if a person moved them: none, a sine, a file."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Protocol

import numpy as np

from joshua.devices.actuator import FloatArray, JointLimits
from joshua.devices.errors import ConfigurationError


class Motion(Protocol):
    """Positions and velocities of all joints as a function of time."""

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Positions in radians and velocities in rad/s, shape (N,) each, ``time_s`` after the start."""


class SineMotion:
    """Each joint follows a sine around the middle of its range, with evenly spaced phases.

    Args:
        limits: ranges of the joints; the amplitude is clipped to them.
        amplitude_rad: amplitude of the sine.
        frequency_hz: of the sine, in Hz.
    """

    def __init__(self, limits: JointLimits, amplitude_rad: float, frequency_hz: float) -> None:
        low, high = limits.position_min_rad, limits.position_max_rad
        self._middle = (low + high) / 2
        self._amplitude = np.minimum(amplitude_rad, (high - low) / 2)
        self._phase = np.arange(len(low)) * math.tau / max(len(low), 1)
        self._angular_rate = math.tau * frequency_hz

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """See ``Motion``."""
        angle = self._angular_rate * time_s + self._phase
        position = self._middle + self._amplitude * np.sin(angle)
        return position, self._amplitude * self._angular_rate * np.cos(angle)


class FileMotion:
    """Replays a CSV file once, linear between its samples, and stays at the last one.

    The first line names the columns, ``time_s`` and each joint; further lines hold seconds and radians.

    Args:
        path: the file.
        joint_names: joints in joint order; each needs a column.

    Raises:
        ConfigurationError: the file cannot be read, or a line is invalid. The message names file and line.
    """

    def __init__(self, path: str, joint_names: tuple[str, ...]) -> None:
        try:
            with Path(path).open(newline="", encoding="utf-8") as file:
                rows = [(number, row) for number, row in enumerate(csv.reader(file), start=1) if row]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise ConfigurationError(
                f"motion_file {path} cannot be read: {error}; name a CSV file with the columns "
                f"{','.join(('time_s', *joint_names))}"
            ) from error
        columns = _columns(path, rows[0][1] if rows else [], joint_names)
        samples = np.array([_sample(path, number, row, columns) for number, row in rows[1:]])
        if not len(samples):
            raise ConfigurationError(
                f"motion_file {path} contains no sample: add lines below the column names"
            )
        backwards = np.flatnonzero(np.diff(samples[:, 0]) <= 0)
        if len(backwards):
            number = rows[int(backwards[0]) + 2][0]
            raise ConfigurationError(f"motion_file {path}, line {number}: time_s does not increase")
        self._times, self._positions = samples[:, 0], samples[:, 1:]

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """See ``Motion``."""
        times, positions = self._times, self._positions
        if time_s >= times[-1] or len(times) == 1 or time_s <= times[0]:
            at = positions[-1] if time_s >= times[-1] else positions[0]
            return at.copy(), np.zeros_like(at)
        index = int(np.searchsorted(times, time_s, side="right"))
        span = times[index] - times[index - 1]
        velocity = (positions[index] - positions[index - 1]) / span
        return positions[index - 1] + velocity * (time_s - times[index - 1]), velocity


def _columns(path: str, header: list[str], joint_names: tuple[str, ...]) -> list[int]:
    names = [name.strip() for name in header]
    missing = [name for name in ("time_s", *joint_names) if name not in names]
    if missing:
        raise ConfigurationError(
            f"motion_file {path}, line 1: no column {', '.join(missing)}; "
            f"found {', '.join(names) or 'nothing'}"
        )
    return [names.index(name) for name in ("time_s", *joint_names)]


def _sample(path: str, number: int, row: list[str], columns: list[int]) -> list[float]:
    try:
        values = [float(row[column]) for column in columns]
    except (IndexError, ValueError) as error:
        raise ConfigurationError(
            f"motion_file {path}, line {number}: {len(columns)} numbers are needed, found {','.join(row)!r}"
        ) from error
    if not all(map(math.isfinite, values)):
        raise ConfigurationError(f"motion_file {path}, line {number}: a value is not finite")
    return values
